// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstdint>
#include <string>

#include <nav_msgs/Odometry.h>
#include <nav_msgs/Path.h>
#include <sensor_msgs/LaserScan.h>
#include <situation_awareness/MissionStatus.h>
#include <situation_awareness/PlanDubins.h>
#include <Eigen/Geometry>

#include "situation_awareness/path/circumnavigation.hpp"

namespace situation_awareness {

/// What a message of odometry says of a vehicle in the plane: its yaw is the course over ground, that of the body below
/// 0.5 m/s. Throws std::invalid_argument if a number that is used is not finite or the quaternion is no rotation.
void take_odometry(const nav_msgs::Odometry& msg, MissionInput& input);

/// How far a scanner's beams passed freely, over the ground: those without a hit as far as it reaches, those that say
/// nothing not at all. A scanner that is upside down has its beams turned around. False: the scan's angles, or the
/// tilt, are of no use.
bool free_beams_from_msg(const sensor_msgs::LaserScan& msg, const Eigen::Isometry3d& T_world_lidar, FreeBeams& beams);

/// Poses every 0.5 m, at most 4000.
nav_msgs::Path path_to_msg(const SegmentPath& path, std::int64_t stamp_ns, const std::string& world_frame);

MissionStatus mission_to_msg(const MissionStep& step, double clearance_m, std::int64_t stamp_ns,
                             const std::string& world_frame);

/// Answers the service. What is out of bounds is a refusal.
void plan_dubins(const PlanDubins::Request& request, PlanDubins::Response& response);

}  // namespace situation_awareness

// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstdint>
#include <string>

#include <geometry_msgs/Transform.h>
#include <geometry_msgs/TransformStamped.h>
#include <nav_msgs/Odometry.h>
#include <situation_awareness/LevelFrame.h>
#include <Eigen/Geometry>

#include "situation_awareness/geometry/pose2.hpp"

namespace situation_awareness {

/// Throws std::invalid_argument if a number is not finite or the quaternion is not a rotation.
Eigen::Isometry3d isometry_from_msg(const geometry_msgs::Transform& msg);

geometry_msgs::Transform isometry_to_msg(const Eigen::Isometry3d& T);

/// `T_parent_child` at `stamp_ns`.
geometry_msgs::TransformStamped transform_to_msg(const Eigen::Isometry3d& T_parent_child, std::int64_t stamp_ns,
                                                 const std::string& parent_frame, const std::string& child_frame);

LevelFrame level_to_msg(const Pose2& T_world_level, double height_world_m);

/// Throws std::invalid_argument if a number is not finite.
void level_from_msg(const LevelFrame& msg, Pose2& T_world_level, double& height_world_m);

/// The name of a frame for tf2: old drivers and bags begin frames with a slash, which tf2 refuses.
std::string tf2_frame(const std::string& frame);

}  // namespace situation_awareness

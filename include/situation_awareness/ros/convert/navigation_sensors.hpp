// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <string>

#include <nav_msgs/Odometry.h>
#include <sensor_msgs/Imu.h>
#include <sensor_msgs/NavSatFix.h>

#include "situation_awareness/pose/gps_ins.hpp"

namespace situation_awareness {

/// Specific force (m/s^2) and angular velocity (rad/s) in the axes of the IMU; its orientation is not used.
InertialSample inertial_sample_from_msg(const sensor_msgs::Imu& msg);

/// Latitude, longitude and altitude on the WGS 84 ellipsoid with the covariance of east, north and up; one of unknown
/// type is zero, which GpsIns refuses.
GeodeticFix fix_from_msg(const sensor_msgs::NavSatFix& msg);

/// Pose and twist of the base with their covariances, as REP 103 and nav_msgs have them: the pose is that of the base
/// in the world, and its covariance is of the position along the world's axes and of the small rotation about the
/// world's axes that leads from the estimate to the truth; the twist and its covariance are along the axes of the base.
nav_msgs::Odometry odometry_to_msg(const GpsInsPose& pose, const std::string& world_frame,
                                   const std::string& base_frame);

}  // namespace situation_awareness

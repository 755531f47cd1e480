// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <string>

#include <nav_msgs/Odometry.h>
#include <sensor_msgs/Imu.h>
#include <sensor_msgs/NavSatFix.h>

#include "situation_awareness/sim/gnss.hpp"
#include "situation_awareness/sim/imu.hpp"
#include "situation_awareness/sim/wheel_odometry.hpp"
#include "situation_awareness/sim/world.hpp"

namespace situation_awareness {

/// Specific force (m/s^2) and angular velocity (rad/s) in the IMU's axes, with the variance of the white noise of one
/// sample; the biases are not in it. The orientation is not measured: orientation_covariance[0] is -1.
sensor_msgs::Imu imu_to_msg(const ImuSample& sample, const SimulatedImuParams& params, const std::string& imu_frame);

/// Latitude and longitude in degrees, altitude in m above the WGS 84 ellipsoid. The covariance is that of east, north
/// and up at the world's origin, in m^2; at a distance d from there they are turned by d / 6400 km, which is neglected.
sensor_msgs::NavSatFix fix_to_msg(const GnssFix& fix, const WorldOrigin& origin, const std::string& antenna_frame);

/// Variance of what wheels do not measure: height, roll and pitch, and their rates.
constexpr double kUnmeasuredVariance = 1e6;

/// Pose of the base in `odom_frame`, where it was at time 0, with z = 0; twist in the base's axes. Units are m, rad and
/// s; what wheels do not measure is 0 with kUnmeasuredVariance.
nav_msgs::Odometry odometry_to_msg(const OdometrySample& sample, const std::string& odom_frame,
                                   const std::string& base_frame);

}  // namespace situation_awareness

// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <sensor_msgs/Imu.h>
#include <sensor_msgs/NavSatFix.h>

#include "situation_awareness/pose/gps_ins.hpp"

namespace situation_awareness {

/// Specific force (m/s^2) and angular velocity (rad/s) in the axes of the IMU; its orientation is not used.
InertialSample inertial_sample_from_msg(const sensor_msgs::Imu& msg);

/// Latitude, longitude and altitude on the WGS 84 ellipsoid with the covariance of east, north and up; one of unknown
/// type is zero, which GpsIns refuses.
GeodeticFix fix_from_msg(const sensor_msgs::NavSatFix& msg);

}  // namespace situation_awareness

// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <string>

#include <ros/time.h>
#include <sensor_msgs/LaserScan.h>

#include "situation_awareness/scan/scan.hpp"

namespace situation_awareness {

/// Seconds from beam to beam as the scan says, or 0 where that cannot be: not finite, negative, or more than a second
/// for the whole scan. Drivers leave the field unset, or set it wrong.
double usable_time_increment_s(const sensor_msgs::LaserScan& msg);

/// When the last beam was taken, by its usable time increment.
ros::Time time_of_last_beam(const sensor_msgs::LaserScan& msg);

/// The scan of a driver by REP-117; whether it can be used is `scan_msg_defect`'s to say. Intensities that are not one
/// per range are left out.
Scan scan_from_msg(const sensor_msgs::LaserScan& msg);

/// What a driver that follows REP-117 would publish. Hits outside the volume of interest are hits to the sensor.
/// Intensities are left out where no beam has one.
sensor_msgs::LaserScan scan_to_msg(const Scan& scan, const std::string& lidar_frame, double range_min_m,
                                   double range_max_m, double scan_time_s);

}  // namespace situation_awareness

// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <string>

#include <ros/time.h>
#include <sensor_msgs/LaserScan.h>

#include "situation_awareness/scan/scan.hpp"
#include "situation_awareness/scan/scanner_params.hpp"

namespace situation_awareness {

/// The scan as REP-117 and sensor_msgs/LaserScan have it: +inf where nothing was met, and beams measured in the order
/// of the array, from the stamp on. The message itself where `scanner` has its defaults. Stages and tools do this
/// first, so that all that follows has the times and ranges of one convention.
sensor_msgs::LaserScanConstPtr conventional(const sensor_msgs::LaserScanConstPtr& msg, const ScannerParams& scanner);

/// The scan's time increment in s, or 0 if it is invalid: not finite, negative, or more than a second for the whole
/// scan. Some drivers leave the field unset or set it wrongly.
double usable_time_increment_s(const sensor_msgs::LaserScan& msg);

/// Time of the last beam, by the valid time increment.
ros::Time time_of_last_beam(const sensor_msgs::LaserScan& msg);

/// The scan of a driver by REP-117; `scan_msg_defect` checks its validity. Intensities that are not one per range are
/// left out.
Scan scan_from_msg(const sensor_msgs::LaserScan& msg);

/// The scan as a driver would publish it by REP-117. Hits outside the volume of interest are hits to the sensor.
/// Intensities are left out where no beam has one.
sensor_msgs::LaserScan scan_to_msg(const Scan& scan, const std::string& lidar_frame, double range_min_m,
                                   double range_max_m, double scan_time_s);

}  // namespace situation_awareness

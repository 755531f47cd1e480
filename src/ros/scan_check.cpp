// SPDX-License-Identifier: BSD-3-Clause
#include "situation_awareness/ros/scan_check.hpp"

#include <cmath>

#include "situation_awareness/scan/scan.hpp"

namespace situation_awareness {

std::string scan_msg_defect(const sensor_msgs::LaserScan& msg) {
  const std::string bad = "bad scan: ";
  if (msg.header.frame_id.empty()) return bad + "no frame_id";
  // To TF a stamp of zero means "the latest", which would be a made-up pose.
  if (msg.header.stamp.isZero()) return bad + "stamp is zero";
  if (std::isnan(msg.range_min) || std::isnan(msg.range_max)) return bad + "range limits are not numbers";
  // Which intensity belongs to which range could not be said; a driver without any leaves the field empty.
  if (!msg.intensities.empty() && msg.intensities.size() != msg.ranges.size()) {
    return bad + "intensities are not one per range";
  }
  const std::string defect = scan_defect(msg.ranges.size(), msg.angle_min, msg.angle_increment);
  return defect.empty() ? "" : bad + defect;
}

}  // namespace situation_awareness

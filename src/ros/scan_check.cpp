// SPDX-License-Identifier: BSD-3-Clause
#include "situation_awareness/ros/scan_check.hpp"

#include <cmath>

#include "situation_awareness/scan/scan.hpp"

namespace situation_awareness {

std::string scan_msg_defect(const sensor_msgs::LaserScan& msg) {
  const std::string bad = "bad scan: ";
  if (msg.header.frame_id.empty()) return bad + "no frame_id";
  // TF would interpret a stamp of zero as "the latest transform".
  if (msg.header.stamp.isZero()) return bad + "stamp is zero";
  if (std::isnan(msg.range_min) || std::isnan(msg.range_max)) return bad + "range limits are not numbers";
  // The assignment of intensities to ranges would be unknown; a driver without intensities leaves the field empty.
  if (!msg.intensities.empty() && msg.intensities.size() != msg.ranges.size()) {
    return bad + "intensities are not one per range";
  }
  const std::string defect = scan_defect(msg.ranges.size(), msg.angle_min, msg.angle_increment);
  return defect.empty() ? "" : bad + defect;
}

}  // namespace situation_awareness

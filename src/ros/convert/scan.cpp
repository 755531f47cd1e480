// SPDX-License-Identifier: BSD-3-Clause
#include "situation_awareness/ros/convert/scan.hpp"

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <limits>

#include "situation_awareness/common/time.hpp"
#include "situation_awareness/ros/convert/time.hpp"

namespace situation_awareness {
namespace {

constexpr double kMaxSweep_s = 1.0;

double steps(const sensor_msgs::LaserScan& msg) {
  return msg.ranges.empty() ? 0.0 : static_cast<double>(msg.ranges.size() - 1);
}

}  // namespace

double usable_time_increment_s(const sensor_msgs::LaserScan& msg) {
  const double increment_s = msg.time_increment;
  return increment_s >= 0.0 && increment_s * steps(msg) <= kMaxSweep_s ? increment_s : 0.0;  // NaN gives 0
}

ros::Time time_of_last_beam(const sensor_msgs::LaserScan& msg) {
  const std::int64_t last_ns =
      to_nanoseconds(msg.header.stamp) + nanoseconds(usable_time_increment_s(msg) * steps(msg));
  return to_ros_time(std::min(last_ns, to_nanoseconds(ros::TIME_MAX)));
}

Scan scan_from_msg(const sensor_msgs::LaserScan& msg) {
  Scan scan;
  scan.stamp_ns = to_nanoseconds(msg.header.stamp);
  scan.angle_min_rad = msg.angle_min;
  scan.angle_increment_rad = msg.angle_increment;
  scan.time_increment_s = usable_time_increment_s(msg);
  scan.beams.reserve(msg.ranges.size());
  for (const float range_m : msg.ranges) {
    scan.beams.push_back(beam_from_range(range_m, msg.range_min, msg.range_max));
  }
  if (msg.intensities.size() == msg.ranges.size()) {
    for (std::size_t i = 0; i < scan.beams.size(); ++i) scan.beams[i].intensity = msg.intensities[i];
  }
  return scan;
}

namespace {

float range_of(const Beam& beam) {
  switch (beam.state) {
    case BeamState::kHit:
    case BeamState::kOutside:
      return beam.range_m;
    case BeamState::kFree:
      return std::numeric_limits<float>::infinity();
    case BeamState::kTooClose:
      return -std::numeric_limits<float>::infinity();
    case BeamState::kInvalid:
      break;
  }
  return std::numeric_limits<float>::quiet_NaN();
}

}  // namespace

sensor_msgs::LaserScan scan_to_msg(const Scan& scan, const std::string& lidar_frame, double range_min_m,
                                   double range_max_m, double scan_time_s) {
  sensor_msgs::LaserScan msg;
  msg.header.stamp = to_ros_time(scan.stamp_ns);
  msg.header.frame_id = lidar_frame;
  msg.angle_min = static_cast<float>(scan.angle_min_rad);
  msg.angle_increment = static_cast<float>(scan.angle_increment_rad);
  const auto last = scan.beams.empty() ? 0.0 : static_cast<double>(scan.beams.size() - 1);
  msg.angle_max = static_cast<float>(scan.angle_min_rad + last * scan.angle_increment_rad);
  msg.time_increment = static_cast<float>(scan.time_increment_s);
  msg.scan_time = static_cast<float>(scan_time_s);
  msg.range_min = static_cast<float>(range_min_m);
  msg.range_max = static_cast<float>(range_max_m);
  msg.ranges.reserve(scan.beams.size());
  for (const Beam& beam : scan.beams) msg.ranges.push_back(range_of(beam));
  const auto has_intensity = [](const Beam& beam) { return !std::isnan(beam.intensity); };
  if (std::any_of(scan.beams.begin(), scan.beams.end(), has_intensity)) {
    msg.intensities.reserve(scan.beams.size());
    for (const Beam& beam : scan.beams) msg.intensities.push_back(beam.intensity);
  }
  return msg;
}

}  // namespace situation_awareness

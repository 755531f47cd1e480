// SPDX-License-Identifier: BSD-3-Clause
#include "situation_awareness/ros/convert/scan.hpp"

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <limits>

#include <boost/make_shared.hpp>

#include "situation_awareness/common/time.hpp"
#include "situation_awareness/ros/convert/time.hpp"

namespace situation_awareness {
namespace {

constexpr double kMaxSweep_s = 1.0;

double steps(const sensor_msgs::LaserScan& msg) {
  return msg.ranges.empty() ? 0.0 : static_cast<double>(msg.ranges.size() - 1);
}

/// More than what beam_from_range takes for rounding.
constexpr float kBeyondRounding_m = 1e-3F;

/// Simulators add noise to range_max, too, and cut it off there (gazebo-classic e0bc65c, RaySensor.cc: about half of
/// the beams that meet nothing are then as far below range_max as a beam is noisy). So near to it a hit is none if one
/// of so many beams on each side is range_max itself, a number: a scanner that sends +inf has no such beams.
constexpr float kNoiseAtRangeMax_m = 0.06F;
constexpr std::size_t kBesideRangeMax = 5;

void free_noise_at_range_max(const sensor_msgs::LaserScan& msg, Scan& scan) {
  const auto is_range_max = [&](std::size_t i) {
    return scan.beams[i].state == BeamState::kFree && std::abs(msg.ranges[i] - msg.range_max) <= kBeyondRounding_m;
  };
  std::size_t last = 0;  // range_max until this beam, counted from 1; 0: none yet
  std::size_t next = 0;  // the first range_max from here on
  const std::size_t n = scan.beams.size();
  for (std::size_t i = 0; i < n; ++i) {
    if (is_range_max(i)) last = i + 1;
    for (next = std::max(next, i); next < n && !is_range_max(next);) ++next;
    const Beam& beam = scan.beams[i];
    if (beam.state != BeamState::kHit || beam.range_m < msg.range_max - kNoiseAtRangeMax_m) continue;
    const bool is_beside = (last > 0 && i + 1 - last <= kBesideRangeMax) || (next < n && next - i <= kBesideRangeMax);
    if (is_beside) scan.beams[i] = beam_from_range(msg.range_max, msg.range_min, msg.range_max);
  }
}

void put_inf(const std::string& no_return, sensor_msgs::LaserScan& msg) {
  if (no_return == "inf") msg.range_max += kBeyondRounding_m;  // so that a range of range_max itself is a hit
  for (float& range_m : msg.ranges) {
    const bool is_nothing = (no_return == "zero" && range_m == 0.0F) || (no_return == "nan" && std::isnan(range_m));
    if (is_nothing) range_m = std::numeric_limits<float>::infinity();
  }
}

void put_in_order_of_time(sensor_msgs::LaserScan& msg) {
  msg.angle_min = static_cast<float>(msg.angle_min + steps(msg) * msg.angle_increment);
  msg.angle_max = static_cast<float>(msg.angle_min - steps(msg) * msg.angle_increment);
  msg.angle_increment = -msg.angle_increment;
  std::reverse(msg.ranges.begin(), msg.ranges.end());
  std::reverse(msg.intensities.begin(), msg.intensities.end());
}

/// From the first beam that was measured to the one whose time the stamp is, as a part of the sweep.
double part_at_stamp(const std::string& stamp_at) {
  if (stamp_at == "first") return 0.0;
  return stamp_at == "middle" ? 0.5 : 1.0;
}

}  // namespace

sensor_msgs::LaserScanConstPtr conventional(const sensor_msgs::LaserScanConstPtr& msg, const ScannerParams& scanner) {
  const ScannerParams defaults;
  const double part = part_at_stamp(scanner.stamp_at);
  if (scanner.no_return == defaults.no_return && scanner.beam_order == defaults.beam_order && part == 0.0) return msg;
  const auto result = boost::make_shared<sensor_msgs::LaserScan>(*msg);
  put_inf(scanner.no_return, *result);
  if (scanner.beam_order == "backward") put_in_order_of_time(*result);
  if (!msg->header.stamp.isZero()) {  // else it is refused
    const std::int64_t before_ns = nanoseconds(part * usable_time_increment_s(*msg) * steps(*msg));
    result->header.stamp = to_ros_time(std::max<std::int64_t>(to_nanoseconds(msg->header.stamp) - before_ns, 1));
  }
  return result;
}

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
  free_noise_at_range_max(msg, scan);
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

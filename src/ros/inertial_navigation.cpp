// SPDX-License-Identifier: BSD-3-Clause
#include "situation_awareness/ros/inertial_navigation.hpp"

#include <algorithm>
#include <optional>
#include <utility>
#include <vector>

#include "situation_awareness/common/time.hpp"
#include "situation_awareness/ros/convert/odometry.hpp"
#include "situation_awareness/ros/convert/time.hpp"

namespace situation_awareness {
namespace {

/// Time for which it is kept what was known, where nothing asks for it: no scan waits longer.
constexpr double kKnownFor_s = 2.0 * InertialNavigation::kBacklog_s;
/// Fixes and samples that wait until it is known where the sensors are: of 30 s at 20 Hz and 400 Hz.
constexpr std::size_t kMostFixes = 600, kMostSamples = 12000;

}  // namespace

InertialNavigation::InertialNavigation(const GpsInsNodeletParams& params, const tf2::BufferCore& tf, Use use)
    : input_(params, tf), use_(std::move(use)), odometry_(kKnownFor_s) {
  input_.keep_backlog(kBacklog_s);
}

std::string InertialNavigation::add_imu(const sensor_msgs::Imu& msg, std::int64_t received_ns) {
  samples_.push_back({msg, received_ns});
  std::string reason;
  while (!samples_.empty()) {
    reason = input_.add_imu(samples_.front().msg, samples_.front().received_ns);
    if (input_.filter() == nullptr && input_.waits_for_sensors()) break;
    samples_.pop_front();
    if (!reason.empty()) continue;
    follow();
    use_fixes();
  }
  if (samples_.size() > kMostSamples) samples_.pop_front();
  return reason;
}

/// After a sample that was used.
void InertialNavigation::follow() {
  const GpsIns& filter = *input_.filter();
  if (!filter.is_ready()) {
    if (is_ready()) restart(filter.stamp_ns());
    return;
  }
  const GpsInsPose pose = filter.pose();
  if (!pose.is_ready) return;
  if (!is_ready()) {
    const std::vector<GpsInsPose> earlier = input_.backlog_poses(pose);
    odometry_.begin(pose, earlier);
    for (const GpsInsPose& then : earlier) go_on(then);
  }
  go_on(pose);
  place_fixes();
}

void InertialNavigation::go_on(const GpsInsPose& pose) {
  if (const auto odom = odometry_.add(pose)) use_.add(transform_to_msg(odom->T_odom_base, odom->stamp_ns, "", ""));
}

void InertialNavigation::place_fixes() {
  if (is_ready()) odometry_.place_fixes(*input_.filter()->origin(), input_.antenna_base_m());
}

void InertialNavigation::add_fix(const sensor_msgs::NavSatFix& msg, std::int64_t received_ns) {
  input_.see_fix(msg);
  const auto is_before = [](const ros::Time& stamp, const Waiting<sensor_msgs::NavSatFix>& other) {
    return stamp < other.msg.header.stamp;
  };
  const auto place = std::upper_bound(waiting_fixes_.begin(), waiting_fixes_.end(), msg.header.stamp, is_before);
  waiting_fixes_.insert(place, {msg, received_ns});
  if (waiting_fixes_.size() > kMostFixes) waiting_fixes_.pop_front();
  if (const GpsIns* const filter = input_.filter()) {
    const double age_s = seconds_between(to_nanoseconds(msg.header.stamp), filter->stamp_ns());
    if (age_s >= kPatience_s && age_s < InertialOdometry::kLatestFix_s) ++late_fixes_;
    use_fixes();
  }
}

/// Those whose time it is. What is so far from the samples that it cannot wait for them is refused by the filter.
void InertialNavigation::use_fixes() {
  const std::int64_t now_ns = input_.filter()->stamp_ns();
  const auto age_s = [now_ns](const Waiting<sensor_msgs::NavSatFix>& fix) {
    return seconds_between(to_nanoseconds(fix.msg.header.stamp), now_ns);
  };
  for (; !waiting_fixes_.empty() && age_s(waiting_fixes_.front()) >= kPatience_s; waiting_fixes_.pop_front()) {
    use_fix(waiting_fixes_.front());
  }
  for (; !waiting_fixes_.empty() && age_s(waiting_fixes_.back()) < -InertialOdometry::kLatestFix_s;
       waiting_fixes_.pop_back()) {
    use_fix(waiting_fixes_.back());
  }
}

void InertialNavigation::use_fix(const Waiting<sensor_msgs::NavSatFix>& waiting) {
  input_.add_fix(waiting.msg, waiting.received_ns);
  if (const std::optional<GeodeticFix>& fix = input_.good_fix()) odometry_.add_fix(*fix, input_.filter()->stamp_ns());
  place_fixes();
}

void InertialNavigation::restart(std::int64_t stamp_ns) {
  use_.restart();
  odometry_.restart(stamp_ns);
}

}  // namespace situation_awareness

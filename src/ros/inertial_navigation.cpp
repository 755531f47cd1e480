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

InertialNavigation::InertialNavigation(const GpsInsNodeletParams& params, const tf2::BufferCore& tf, Use use,
                                       double patience_s)
    : input_(params, tf), use_(std::move(use)), patience_s_(patience_s), odometry_(kKnownFor_s) {
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
    use_waiting();
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

template <class Message>
void InertialNavigation::insert(Queue<Message>& queue, const Message& msg, std::int64_t received_ns) {
  const auto is_before = [](const ros::Time& stamp, const Waiting<Message>& other) {
    return stamp < other.msg.header.stamp;
  };
  const auto place = std::upper_bound(queue.begin(), queue.end(), msg.header.stamp, is_before);
  queue.insert(place, {msg, received_ns});
  if (queue.size() > kMostFixes) queue.pop_front();
}

void InertialNavigation::add_fix(const sensor_msgs::NavSatFix& msg, std::int64_t received_ns) {
  input_.see_fix(msg);
  insert(waiting_fixes_, msg, received_ns);
  if (const GpsIns* const filter = input_.filter()) {
    const double age_s = seconds_between(to_nanoseconds(msg.header.stamp), filter->stamp_ns());
    if (age_s >= patience_s_ && age_s < InertialOdometry::kLatestFix_s) ++late_fixes_;
    use_waiting();
  }
}

void InertialNavigation::add_velocity(const geometry_msgs::TwistWithCovarianceStamped& msg) {
  insert(waiting_velocities_, msg, StampOrder::kNone);
  if (input_.filter() != nullptr) use_waiting();
}

void InertialNavigation::use_waiting() {
  use_waiting(waiting_fixes_);
  use_waiting(waiting_velocities_);
}

/// Those whose time it is. What is so far from the samples that it cannot wait for them is refused by the filter.
template <class Message>
void InertialNavigation::use_waiting(Queue<Message>& queue) {
  const std::int64_t now_ns = input_.filter()->stamp_ns();
  const auto age_s = [now_ns](const Waiting<Message>& waiting) {
    return seconds_between(to_nanoseconds(waiting.msg.header.stamp), now_ns);
  };
  for (; !queue.empty() && age_s(queue.front()) >= patience_s_; queue.pop_front()) use(queue.front());
  for (; !queue.empty() && age_s(queue.back()) < -InertialOdometry::kLatestFix_s; queue.pop_back()) use(queue.back());
}

void InertialNavigation::use(const Waiting<sensor_msgs::NavSatFix>& fix) {
  input_.add_fix(fix.msg, fix.received_ns);
  if (const std::optional<GeodeticFix>& good = input_.good_fix()) {
    odometry_.add_fix(*good, input_.filter()->stamp_ns());
  }
  place_fixes();
}

void InertialNavigation::use(const Waiting<geometry_msgs::TwistWithCovarianceStamped>& velocity) {
  input_.add_velocity(velocity.msg);
}

void InertialNavigation::restart(std::int64_t stamp_ns) {
  use_.restart();
  odometry_.restart(stamp_ns);
}

}  // namespace situation_awareness

// SPDX-License-Identifier: BSD-3-Clause
#include "situation_awareness/ros/odometry_covariances.hpp"

#include <iterator>

#include "situation_awareness/common/time.hpp"
#include "situation_awareness/estimation/covariance.hpp"
#include "situation_awareness/ros/convert/time.hpp"

namespace situation_awareness {

void OdometryCovariances::add(const nav_msgs::Odometry& msg, std::int64_t received_ns) {
  constexpr std::size_t kKept = 10000;
  CameraPoseCovariance covariance;
  for (int i = 0; i < 36; ++i) covariance(i / 6, i % 6) = msg.pose.covariance[static_cast<std::size_t>(i)];
  if (!is_positive_semidefinite(covariance) || covariance.isZero(0.0)) {
    ++unknown_;
    return;
  }
  const StampOrder::Verdict verdict = order_.judge(to_nanoseconds(msg.header.stamp), received_ns);
  if (verdict == StampOrder::Verdict::kRefused) {
    ++refused_;
    return;
  }
  if (verdict == StampOrder::Verdict::kRestart) covariances_.clear();
  covariances_[to_nanoseconds(msg.header.stamp)] = 0.5 * (covariance + covariance.transpose());
  if (covariances_.size() > kKept) covariances_.erase(covariances_.begin());
}

std::optional<CameraPoseCovariance> OdometryCovariances::at(std::int64_t stamp_ns) const {
  constexpr double kMaxAge_s = 0.2;
  const auto after = covariances_.upper_bound(stamp_ns);
  if (after != covariances_.begin()) {
    const auto& [before_ns, covariance] = *std::prev(after);
    if (seconds_between(before_ns, stamp_ns) < kMaxAge_s) return covariance;
  }
  if (after != covariances_.end() && seconds_between(stamp_ns, after->first) < kMaxAge_s) return after->second;
  return {};
}

}  // namespace situation_awareness

// SPDX-License-Identifier: BSD-3-Clause
#include "situation_awareness/estimation/pose_covariances.hpp"

#include <cmath>
#include <iterator>

#include "situation_awareness/common/time.hpp"
#include "situation_awareness/estimation/covariance.hpp"

namespace situation_awareness {

bool is_usable(const BasePose& pose) {
  const Eigen::Matrix3d& P = pose.covariance_world;
  return pose.translation_world_m.allFinite() && is_positive_semidefinite(P) && P(0, 0) > 0.0 && P(1, 1) > 0.0;
}

bool PoseCovariances::add(std::int64_t stamp_ns, const BasePose& pose) {
  refuse(stamp_ns);
  if (!is_usable(pose)) return false;
  poses_[stamp_ns] = pose;
  return true;
}

void PoseCovariances::refuse(std::int64_t stamp_ns) {
  expect();
  last_ns_ = stamp_ns;
  poses_[stamp_ns].reset();
  if (poses_.size() <= kMost) return;
  // The farthest in time, on either side: after a restart of time those before are ahead.
  const auto first = poses_.begin(), last = std::prev(poses_.end());
  const bool is_first = seconds_between(first->first, stamp_ns) >= seconds_between(stamp_ns, last->first);
  poses_.erase(is_first ? first : last);
}

std::optional<BasePose> PoseCovariances::at(std::int64_t stamp_ns) const {
  auto nearest = poses_.lower_bound(stamp_ns);
  const auto apart_s = [&](const auto& pose) { return std::abs(seconds_between(pose->first, stamp_ns)); };
  if (nearest != poses_.begin()) {
    const auto before = std::prev(nearest);
    if (nearest == poses_.end() || apart_s(before) < apart_s(nearest)) nearest = before;
  }
  if (nearest == poses_.end() || !(apart_s(nearest) <= max_age_s_)) return {};
  return nearest->second;
}

std::optional<BasePose> PoseCovariances::latest(std::int64_t now_ns) const {
  const auto last = poses_.find(last_ns_);
  if (last == poses_.end() || !(std::abs(seconds_between(last_ns_, now_ns)) <= max_age_s_)) return {};
  return last->second;
}

}  // namespace situation_awareness

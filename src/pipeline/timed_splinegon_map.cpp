// SPDX-License-Identifier: BSD-3-Clause
#include "situation_awareness/pipeline/timed_splinegon_map.hpp"

#include <algorithm>
#include <limits>
#include <utility>

namespace situation_awareness {

TimedSplinegonMap::TimedSplinegonMap(const SplinegonPipelineParams& params, double reset_time_jump_s)
    : order_(reset_time_jump_s), pipeline_(params) {}

template <class... Pose>
StampOrder::Verdict TimedSplinegonMap::process_in_order(const Scan& scan, const Pose&... pose) {
  if (resumed_) {
    // The clock may have begun anew since the boundaries were saved; no such scan is refused.
    if (scan.stamp_ns <= splinegons_.stamp_ns) resume_before(scan.stamp_ns);
    order_.reset();
    resumed_ = false;
  }
  const StampOrder before = order_;
  const StampOrder::Verdict verdict = order_.judge(scan.stamp_ns);
  if (verdict == StampOrder::Verdict::kRefused) return verdict;
  if (verdict == StampOrder::Verdict::kRestart) pipeline_.reset();
  try {
    pipeline_.process(scan, pose...);
  } catch (...) {
    if (verdict == StampOrder::Verdict::kNext) order_ = before;  // only what is used counts
    throw;
  }
  take_over();
  return verdict;
}

StampOrder::Verdict TimedSplinegonMap::process(const Scan& scan, const Eigen::Isometry3d& T_world_lidar,
                                               const Eigen::Isometry3d& T_world_lidar_end,
                                               const Eigen::Matrix3d& pose_covariance) {
  return process_in_order(scan, T_world_lidar, T_world_lidar_end, pose_covariance);
}

StampOrder::Verdict TimedSplinegonMap::process(const Scan& scan, const Eigen::Isometry3d& T_odom_lidar,
                                               const Eigen::Isometry3d& T_odom_lidar_end,
                                               const InertialPlacement& placement) {
  return process_in_order(scan, T_odom_lidar, T_odom_lidar_end, placement);
}

void TimedSplinegonMap::take_over() {
  splinegons_ = pipeline_.splinegons();
  splinegons_.height_world_m = pipeline_.polylines().height_world_m;
  std::sort(splinegons_.boundaries.begin(), splinegons_.boundaries.end(),
            [](const Splinegon& a, const Splinegon& b) { return a.id < b.id; });
}

Splinegons TimedSplinegonMap::at(std::int64_t stamp_ns) const {
  Splinegons then = splinegons_;
  then.stamp_ns = stamp_ns;
  return then;
}

void TimedSplinegonMap::reset() {
  pipeline_.reset();
  order_.reset();
  splinegons_ = {};
  resumed_ = false;
}

SplinegonMapSnapshot TimedSplinegonMap::snapshot() const { return {"", splinegons_.stamp_ns, splinegons_.boundaries}; }

void TimedSplinegonMap::resume(const SplinegonMapSnapshot& snapshot) {
  const Splinegons before = std::move(splinegons_);
  splinegons_ = {snapshot.stamp_ns, snapshot.elements, before.height_world_m};
  const std::int64_t latest_ns = stamp_ns();
  try {
    resume_before(latest_ns == kNoStamp ? std::numeric_limits<std::int64_t>::max() : latest_ns);
  } catch (...) {
    splinegons_ = before;
    throw;
  }
  if (latest_ns != kNoStamp) {
    splinegons_.stamp_ns = latest_ns;
  } else {
    order_.judge(splinegons_.stamp_ns);
    resumed_ = true;
  }
}

void TimedSplinegonMap::resume_before(std::int64_t stamp_ns) {
  const std::int64_t latest_ns = stamp_ns - 1;
  for (Splinegon& splinegon : splinegons_.boundaries) {
    splinegon.first_seen_ns = std::min(splinegon.first_seen_ns, latest_ns);
    splinegon.last_seen_ns = std::min(splinegon.last_seen_ns, latest_ns);
  }
  splinegons_.stamp_ns = std::min(splinegons_.stamp_ns, latest_ns);
  pipeline_.resume(splinegons_);
  take_over();
}

}  // namespace situation_awareness

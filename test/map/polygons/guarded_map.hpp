// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstddef>
#include <cstdint>
#include <utility>

#include "situation_awareness/common/stamp_order.hpp"
#include "situation_awareness/map/polygons/polygon_map.hpp"

namespace situation_awareness {

/// A map of polygons behind the checks that its pipelines and stages make: of numbers and of stamps.
class GuardedMap {
 public:
  explicit GuardedMap(const PolygonMapParams& params) : map_(params) {}

  /// Whether the scan was used.
  bool update(const Polylines& polylines, const Eigen::Matrix3d& pose_covariance) {
    if (!can_be_mapped(polylines, pose_covariance)) return false;
    const StampOrder::Verdict verdict = order_.judge(polylines.stamp_ns);
    if (verdict == StampOrder::Verdict::kRefused) return false;
    if (verdict == StampOrder::Verdict::kRestart) map_.reset();
    update_ = map_.update(polylines, pose_covariance, std::move(update_));
    map_.update_due_chains();
    return true;
  }
  void reset() {
    map_.reset();
    map_.update_chains();
    order_.reset();
  }

  std::int64_t stamp_ns() const { return order_.latest_ns(); }
  PolygonMap& map() { return map_; }
  Polygons polygons() { return map_.latest_polygons(); }

 private:
  StampOrder order_;
  PolygonMap map_;
  PolygonMapUpdate update_;
};

}  // namespace situation_awareness

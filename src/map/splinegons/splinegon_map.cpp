// SPDX-License-Identifier: BSD-3-Clause
#include "situation_awareness/map/splinegons/splinegon_map.hpp"

#include <algorithm>
#include <utility>

namespace situation_awareness {

SplinegonMap::SplinegonMap(const SplinegonMapParams& params, const SplinegonFitParams& fit)
    : params_((params.validate(), params)), fit_(fit) {}

/// By the box around its elements, whose diagonal is at most 1.42 times as large as the distance.
bool SplinegonMap::is_large(const ObstacleBoundary& boundary) const {
  if (boundary.elements.empty()) return false;
  Eigen::Vector2d low_m = boundary.elements.front().p_world_m, high_m = low_m;
  for (const SplinegonElement& element : boundary.elements) {
    low_m = low_m.cwiseMin(element.p_world_m);
    high_m = high_m.cwiseMax(element.p_world_m);
  }
  return (high_m - low_m).norm() >= params_.min_extent_m;
}

const Splinegons& SplinegonMap::update(std::int64_t stamp_ns, const std::vector<ObstacleBoundary>& boundaries,
                                       double common_variance_m2) {
  std::swap(splinegons_, before_);
  splinegons_.stamp_ns = stamp_ns;
  std::size_t count = 0;
  for (const ObstacleBoundary& boundary : boundaries) {
    if (!is_large(boundary)) continue;
    if (splinegons_.boundaries.size() == count) splinegons_.boundaries.emplace_back();
    Splinegon& result = splinegons_.boundaries[count];
    const auto earlier = std::find_if(before_.boundaries.begin(), before_.boundaries.end(),
                                      [&](const Splinegon& other) { return other.id == boundary.id; });
    result.vertices.clear();
    const bool is_same = earlier != before_.boundaries.end() && earlier->closed == boundary.closed;
    if (is_same) result.vertices.assign(earlier->vertices.begin(), earlier->vertices.end());
    if (!is_same || boundary.last_seen_ns == stamp_ns) {
      fit_.fit(boundary.elements, boundary.closed, common_variance_m2, result.vertices);
    }
    if (result.vertices.empty()) continue;
    result.id = boundary.id;
    result.closed = boundary.closed;
    result.first_seen_ns = boundary.first_seen_ns;
    result.last_seen_ns = boundary.last_seen_ns;
    ++count;
  }
  splinegons_.boundaries.resize(count);
  return splinegons_;
}

}  // namespace situation_awareness

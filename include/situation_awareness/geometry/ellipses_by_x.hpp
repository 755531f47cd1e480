// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <algorithm>
#include <utility>
#include <vector>

#include <Eigen/Core>

#include "situation_awareness/geometry/ellipse.hpp"

namespace situation_awareness {

/// Overlap queries against many ellipses, limited to those nearby.
class EllipsesByX {
 public:
  EllipsesByX() = default;
  explicit EllipsesByX(std::vector<Ellipse> ellipses) : ellipses_(std::move(ellipses)) {
    for (const Ellipse& ellipse : ellipses_) reach_m_ = std::max({reach_m_, ellipse.rx_m, ellipse.ry_m});
    std::sort(ellipses_.begin(), ellipses_.end(),
              [](const Ellipse& a, const Ellipse& b) { return a.center_m.x() < b.center_m.x(); });
  }

  /// Releases its ellipses, in any order, so that their memory can be reused.
  std::vector<Ellipse> release() {
    reach_m_ = 0.0;
    return std::move(ellipses_);
  }

  /// Whether a point lies on one.
  bool cover(const Eigen::Vector2d& point) const {
    return any_within(0.0, point, [&](const Ellipse& other) { return contains(other, point); });
  }

  /// Whether the centre of an ellipse lies on one that is larger.
  bool cover_by_larger(const Ellipse& ellipse) const {
    return any_within(0.0, ellipse.center_m, [&](const Ellipse& other) {
      return other.rx_m * other.ry_m > ellipse.rx_m * ellipse.ry_m && contains(other, ellipse.center_m);
    });
  }

  /// Whether an ellipse overlaps one by more than a quarter of its width along the line of their centres: more than
  /// errors cause for two that touch.
  bool overlap(const Ellipse& ellipse) const {
    return any_within(std::max(ellipse.rx_m, ellipse.ry_m), ellipse.center_m, [&](const Ellipse& other) {
      const Eigen::Vector2d d = other.center_m - ellipse.center_m;
      const double distance2 = d.squaredNorm();
      if (distance2 == 0.0) return true;
      return distance2 < half_width_m(other, d) + 0.5 * half_width_m(ellipse, d);  // times the length of d
    });
  }

 private:
  template <class Predicate>
  bool any_within(double reach_m, const Eigen::Vector2d& point, Predicate&& predicate) const {
    reach_m += reach_m_;
    auto near = std::lower_bound(ellipses_.begin(), ellipses_.end(), point.x() - reach_m,
                                 [](const Ellipse& ellipse, double x_m) { return ellipse.center_m.x() < x_m; });
    for (; near != ellipses_.end() && near->center_m.x() <= point.x() + reach_m; ++near) {
      if (predicate(*near)) return true;
    }
    return false;
  }

  std::vector<Ellipse> ellipses_;
  double reach_m_ = 0.0;  ///< of the largest
};

}  // namespace situation_awareness

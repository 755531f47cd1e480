// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <algorithm>
#include <utility>
#include <vector>

#include <Eigen/Core>

#include "situation_awareness/geometry/ellipse.hpp"

namespace situation_awareness {

/// Answers whether a point lies on one of many ellipses, looking only at those near it.
class EllipsesByX {
 public:
  explicit EllipsesByX(std::vector<Ellipse> ellipses) : ellipses_(std::move(ellipses)) {
    for (const Ellipse& ellipse : ellipses_) reach_m_ = std::max({reach_m_, ellipse.rx_m, ellipse.ry_m});
    std::sort(ellipses_.begin(), ellipses_.end(),
              [](const Ellipse& a, const Ellipse& b) { return a.center_m.x() < b.center_m.x(); });
  }

  bool cover(const Eigen::Vector2d& point) const {
    auto near = std::lower_bound(ellipses_.begin(), ellipses_.end(), point.x() - reach_m_,
                                 [](const Ellipse& ellipse, double x_m) { return ellipse.center_m.x() < x_m; });
    for (; near != ellipses_.end() && near->center_m.x() <= point.x() + reach_m_; ++near) {
      if (contains(*near, point)) return true;
    }
    return false;
  }

 private:
  std::vector<Ellipse> ellipses_;
  double reach_m_ = 0.0;  ///< of the largest
};

}  // namespace situation_awareness

// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <algorithm>
#include <cmath>
#include <cstddef>

#include <Eigen/Core>

#include "directions.hpp"
#include "situation_awareness/geometry/vectors.hpp"

namespace situation_awareness {

/// A weighted total least squares line.
struct LineSums {
  double w = 0.0, x = 0.0, y = 0.0, xx = 0.0, xy = 0.0, yy = 0.0;
  std::size_t n = 0;

  void add(const Eigen::Vector2d& p, double weight) {
    w += weight;
    x += weight * p.x();
    y += weight * p.y();
    xx += weight * p.x() * p.x();
    xy += weight * p.x() * p.y();
    yy += weight * p.y() * p.y();
    ++n;
  }

  struct Line {
    Eigen::Vector2d mean, along;
    double chi2, turn_variance;
  };

  struct Squares {
    double xx, xy, yy;
  };

  /// About the mean.
  Squares squares(const Eigen::Vector2d& mean) const {
    return {xx - w * mean.x() * mean.x(), xy - w * mean.x() * mean.y(), yy - w * mean.y() * mean.y()};
  }

  /// Along the line, of any length: zero where there is none.
  Eigen::Vector2d along() const {
    const Squares s = squares({x / w, y / w});
    const double by_cos = s.xx - s.yy, by_sin = 2.0 * s.xy, both = std::sqrt(by_cos * by_cos + by_sin * by_sin);
    if (by_cos > 0.0) return {both + by_cos, by_sin};
    return {std::abs(by_sin), std::copysign(both - by_cos, by_sin)};
  }

  Line line() const {
    const Eigen::Vector2d mean(x / w, y / w);
    const auto [sxx, sxy, syy] = squares(mean);
    const Eigen::Vector2d along = unit(0.5 * std::atan2(2.0 * sxy, sxx - syy));
    const Eigen::Vector2d normal = left_of(along);
    const double chi2 =
        normal.x() * normal.x() * sxx + 2.0 * normal.x() * normal.y() * sxy + normal.y() * normal.y() * syy;
    return {mean, along, std::max(chi2, 0.0), 1.0 / std::max(sxx + syy - chi2, 1e-9)};
  }
};

}  // namespace situation_awareness

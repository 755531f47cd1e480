// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cmath>
#include <limits>

#include <Eigen/Core>
#include <Eigen/LU>

#include "situation_awareness/geometry/ellipse.hpp"

namespace situation_awareness {

/// Outline of an ellipse, for distances of points.
struct Outline {
  Eigen::Vector2d center_m;
  Eigen::Matrix2d inverse_shape;
};

inline Outline outline_of(const Ellipse& ellipse) { return {ellipse.center_m, shape_matrix(ellipse).inverse()}; }

/// Distance of a point from the outline along the line to its centre; negative inside.
inline double offset_m(const Outline& outline, const Eigen::Vector2d& p) {
  const Eigen::Vector2d d = p - outline.center_m;
  const double scale = std::sqrt(d.dot(outline.inverse_shape * d));
  return scale > 1e-9 ? d.norm() * (1.0 - 1.0 / scale) : -std::numeric_limits<double>::infinity();
}

}  // namespace situation_awareness

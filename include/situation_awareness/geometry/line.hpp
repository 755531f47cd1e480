// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <Eigen/Core>

namespace situation_awareness {

/// A straight line in the plane.
struct Line {
  Eigen::Vector2d through_m = Eigen::Vector2d::Zero();
  Eigen::Vector2d normal = Eigen::Vector2d::UnitX();  ///< of length 1
};

/// Unit vector along the line: its normal rotated counter-clockwise by 90 degrees.
inline Eigen::Vector2d along(const Line& line) { return {-line.normal.y(), line.normal.x()}; }

/// Distance of a point from the line, positive on the side to which the normal points.
inline double offset_m(const Line& line, const Eigen::Vector2d& p) { return line.normal.dot(p - line.through_m); }

}  // namespace situation_awareness

// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <Eigen/Core>

namespace situation_awareness {

/// The weighted least squares circle, or line, y = c0 + c1 x + c2 (x^2 + y^2), with x along the chord: exact for
/// circles.
struct CircleSums {
  Eigen::Matrix3d A = Eigen::Matrix3d::Zero();
  Eigen::Vector3d rhs = Eigen::Vector3d::Zero();

  void add(const Eigen::Vector2d& p, double weight) { add({1.0, p.x(), p.squaredNorm()}, p.y(), weight); }
  /// Adds another equation of the three numbers: y = row^T c.
  void add(const Eigen::Vector3d& row, double y, double weight) {
    A += weight * row * row.transpose();
    rhs += weight * y * row;
  }
  Eigen::Vector3d solve() const;
};

/// The distance in y by which a place is off the circle, and its gradient but for its sign in x.
inline double circle_offset(const Eigen::Vector3d& c, const Eigen::Vector2d& p) {
  return p.y() - c(0) - c(1) * p.x() - c(2) * p.squaredNorm();
}
inline Eigen::Vector2d circle_gradient(const Eigen::Vector3d& c, const Eigen::Vector2d& p) {
  return {c(1) + 2.0 * c(2) * p.x(), 1.0 - 2.0 * c(2) * p.y()};
}

}  // namespace situation_awareness

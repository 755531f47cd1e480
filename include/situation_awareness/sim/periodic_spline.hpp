// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <Eigen/Core>

namespace situation_awareness {

/// Closed curve through given points: a periodic quintic B-spline with uniform knots. It has four continuous
/// derivatives, so that the angular velocity of a multirotor that follows it is smooth.
class PeriodicSpline {
 public:
  /// One point per column, at least three. Point i is the curve's point at u = i.
  explicit PeriodicSpline(const Eigen::MatrixXd& points);

  /// The curve's derivative of order `derivative` (0 to 4) with respect to u, at any u; the period is the number of
  /// points.
  Eigen::VectorXd operator()(double u, int derivative = 0) const;

  double period() const { return static_cast<double>(control_points_.cols()); }

 private:
  Eigen::MatrixXd control_points_;
};

}  // namespace situation_awareness

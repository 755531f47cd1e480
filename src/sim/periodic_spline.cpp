// SPDX-License-Identifier: BSD-3-Clause
#include "situation_awareness/sim/periodic_spline.hpp"

#include <array>
#include <cmath>

#include <Eigen/LU>

namespace situation_awareness {
namespace {

constexpr int kDegree = 5;

/// Derivative of the uniform B-spline of degree 5 that is not zero on (0, 6), as a sum of truncated powers:
/// B(x) = sum_k (-1)^k C(6, k) max(x - k, 0)^5 / 5!. Called often by worlds whose beams have their own times.
double basis(double x, int derivative) {
  constexpr std::array<double, kDegree + 2> kSignedBinomial = {1.0, -6.0, 15.0, -20.0, 15.0, -6.0, 1.0};
  const int power = kDegree - derivative;
  double sum = 0.0;
  for (int k = 0; k <= kDegree + 1 && x > k; ++k) {
    double term = kSignedBinomial[static_cast<std::size_t>(k)];
    for (int i = 1; i <= power; ++i) term *= (x - k) / i;
    sum += term;
  }
  return sum;
}

Eigen::Index wrap(Eigen::Index i, Eigen::Index n) { return ((i % n) + n) % n; }

}  // namespace

PeriodicSpline::PeriodicSpline(const Eigen::MatrixXd& points) {
  // At a knot the six bases reduce to five: point_i = sum_j B(3 + j) control_{i+j}, j = -2 ... 2. The matrix is
  // circulant with eigenvalues (66 + 52 cos a + 2 cos 2a) / 120 >= 16 / 120, so it has an inverse.
  const Eigen::Index n = points.cols();
  Eigen::MatrixXd weights = Eigen::MatrixXd::Zero(n, n);
  for (Eigen::Index i = 0; i < n; ++i) {
    for (int j = -2; j <= 2; ++j) weights(wrap(i + j, n), i) += basis(3.0 + j, 0);
  }
  control_points_ = weights.transpose().partialPivLu().solve(points.transpose()).transpose();
}

Eigen::VectorXd PeriodicSpline::operator()(double u, int derivative) const {
  const Eigen::Index n = control_points_.cols();
  const double wrapped = u - std::floor(u / period()) * period();
  const double knot = std::floor(wrapped);
  const double s = wrapped - knot;
  Eigen::VectorXd sum = Eigen::VectorXd::Zero(control_points_.rows());
  for (int j = -2; j <= 3; ++j) {  // the bases centred at knot + j that reach u
    sum += basis(s - j + 3.0, derivative) * control_points_.col(wrap(static_cast<Eigen::Index>(knot) + j, n));
  }
  return sum;
}

}  // namespace situation_awareness

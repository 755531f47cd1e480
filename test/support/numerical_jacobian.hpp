// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <Eigen/Core>

namespace situation_awareness {

/// d(f) / d(x) at `x` by central differences.
template <int Rows, int Columns, class Function>
Eigen::Matrix<double, Rows, Columns> numerical_jacobian(const Function& f, const Eigen::Matrix<double, Columns, 1>& x) {
  constexpr double kStep = 1e-5;
  Eigen::Matrix<double, Rows, Columns> J;
  for (int k = 0; k < Columns; ++k) {
    const Eigen::Matrix<double, Columns, 1> d = kStep * Eigen::Matrix<double, Columns, 1>::Unit(k);
    J.col(k) = (f(x + d) - f(x - d)) / (2.0 * kStep);
  }
  return J;
}

}  // namespace situation_awareness

// SPDX-License-Identifier: BSD-3-Clause
#include "situation_awareness/estimation/covariance.hpp"

#include <Eigen/Eigenvalues>

namespace situation_awareness {

bool is_positive_semidefinite(const SmallCovariance& C) {
  constexpr double kRounding = 1e-9;
  if (C.rows() != C.cols() || !C.allFinite()) return false;
  const double largest = C.cwiseAbs().maxCoeff();
  if (largest == 0.0) return true;
  // Divided by the largest, so that no square overflows.
  const SmallCovariance scaled = C / largest;
  if ((scaled - scaled.transpose()).cwiseAbs().maxCoeff() > kRounding) return false;
  const Eigen::SelfAdjointEigenSolver<SmallCovariance> solver(scaled, Eigen::EigenvaluesOnly);
  return solver.info() == Eigen::Success && solver.eigenvalues().minCoeff() >= -kRounding;
}

}  // namespace situation_awareness

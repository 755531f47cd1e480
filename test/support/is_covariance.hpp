// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <Eigen/Core>
#include <Eigen/Eigenvalues>

namespace situation_awareness {

/// Symmetric to rounding, and no variance or eigenvalue below zero by more than rounding.
template <class Matrix>
bool is_covariance(const Matrix& P) {
  if (!P.allFinite() || !(P.diagonal().array() >= 0.0).all()) return false;
  // Of correlations, so that units and magnitudes do not matter; less than 10 nm, nm/s or nrad is zero and its
  // rounding.
  const auto sigma = P.diagonal().array().sqrt().max(1e-8).matrix().eval();
  const Matrix correlations = sigma.cwiseInverse().asDiagonal() * P * sigma.cwiseInverse().asDiagonal();
  if (!correlations.isApprox(correlations.transpose(), 1e-9)) return false;
  return Eigen::SelfAdjointEigenSolver<Matrix>(correlations).eigenvalues()(0) >= -1e-9;
}

}  // namespace situation_awareness

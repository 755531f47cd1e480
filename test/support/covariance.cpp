// SPDX-License-Identifier: BSD-3-Clause
#include "support/covariance.hpp"

#include <Eigen/Cholesky>
#include <Eigen/Eigenvalues>

namespace situation_awareness {

bool is_covariance(const Eigen::MatrixXd& P) {
  if (!P.allFinite() || !(P.diagonal().array() >= 0.0).all()) return false;
  // Of correlations, so that units and magnitudes do not matter; less than 10 nm, nm/s or nrad is zero and its
  // rounding.
  const Eigen::VectorXd scale = P.diagonal().array().sqrt().max(1e-8).inverse();
  const Eigen::MatrixXd correlations = scale.asDiagonal() * P * scale.asDiagonal();
  return correlations.isApprox(correlations.transpose(), 1e-9) && smallest_eigenvalue(correlations) >= -1e-9;
}

double smallest_eigenvalue(const Eigen::MatrixXd& P) {
  return Eigen::SelfAdjointEigenSolver<Eigen::MatrixXd>(P, Eigen::EigenvaluesOnly).eigenvalues()(0);
}

double mahalanobis2(const Eigen::VectorXd& error, const Eigen::MatrixXd& P) { return error.dot(P.ldlt().solve(error)); }

}  // namespace situation_awareness

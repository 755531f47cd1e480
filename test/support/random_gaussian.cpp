// SPDX-License-Identifier: BSD-3-Clause
#include "support/random_gaussian.hpp"

#include <Eigen/Cholesky>

namespace situation_awareness {

Eigen::MatrixXd random_covariance(int size, Random& random, double sigma) {
  Eigen::MatrixXd L(size, size);
  for (int i = 0; i < size; ++i) {
    for (int j = 0; j < size; ++j) L(i, j) = sigma * random.normal();
  }
  return L * L.transpose() + 0.1 * sigma * sigma * Eigen::MatrixXd::Identity(size, size);
}

Eigen::VectorXd draw_from(const Eigen::MatrixXd& covariance, Random& random) {
  const Eigen::LDLT<Eigen::MatrixXd> ldlt(covariance);
  Eigen::VectorXd normal(covariance.rows());
  for (double& value : normal) value = random.normal();
  const Eigen::VectorXd scaled = ldlt.vectorD().cwiseMax(0.0).cwiseSqrt().cwiseProduct(normal);
  return ldlt.transpositionsP().transpose() * (ldlt.matrixL() * scaled);
}

}  // namespace situation_awareness

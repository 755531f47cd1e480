// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <Eigen/Cholesky>
#include <Eigen/Core>

#include "situation_awareness/common/random.hpp"

namespace situation_awareness {

/// Independent standard normal numbers.
template <int Size>
Eigen::Matrix<double, Size, 1> normal_vector(Random& random) {
  Eigen::Matrix<double, Size, 1> v;
  for (int i = 0; i < Size; ++i) v(i) = random.normal();
  return v;
}

/// Some covariance without structure, its standard deviations around `sigma` times the square root of its size.
template <class Matrix>
Matrix random_covariance(Random& random, double sigma) {
  Matrix L;
  for (int i = 0; i < L.rows(); ++i) {
    for (int j = 0; j < L.cols(); ++j) L(i, j) = sigma * random.normal();
  }
  return L * L.transpose() + 0.1 * sigma * sigma * Matrix::Identity();
}

/// A draw from the normal distribution of mean zero; `covariance` may be singular.
template <int Size>
Eigen::Matrix<double, Size, 1> draw(const Eigen::Matrix<double, Size, Size>& covariance, Random& random) {
  const Eigen::LDLT<Eigen::Matrix<double, Size, Size>> ldlt(covariance);
  const Eigen::Matrix<double, Size, 1> scaled =
      ldlt.vectorD().cwiseMax(0.0).cwiseSqrt().cwiseProduct(normal_vector<Size>(random));
  return ldlt.transpositionsP().transpose() * (ldlt.matrixL() * scaled);
}

}  // namespace situation_awareness

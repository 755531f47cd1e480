// SPDX-License-Identifier: BSD-3-Clause
#pragma once

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

// Compiled once, for matrices of any size: for each fixed size they take the compiler three seconds.
Eigen::MatrixXd random_covariance(int size, Random& random, double sigma);
Eigen::VectorXd draw_from(const Eigen::MatrixXd& covariance, Random& random);

/// Some covariance without structure, its standard deviations around `sigma` times the square root of its size.
template <class Matrix>
Matrix random_covariance(Random& random, double sigma) {
  return random_covariance(Matrix::RowsAtCompileTime, random, sigma);
}

/// A draw from the normal distribution of mean zero; `covariance` may be singular.
template <int Size>
Eigen::Matrix<double, Size, 1> draw(const Eigen::Matrix<double, Size, Size>& covariance, Random& random) {
  return draw_from(covariance, random);
}

}  // namespace situation_awareness

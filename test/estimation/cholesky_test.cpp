// SPDX-License-Identifier: BSD-3-Clause
#include "situation_awareness/estimation/cholesky.hpp"

#include <gtest/gtest.h>

#include <Eigen/Cholesky>

#include "situation_awareness/common/random.hpp"

namespace situation_awareness::cholesky_test {
namespace {

using Matrix5d = Eigen::Matrix<double, 5, 5>;

template <int Rows, int Columns>
Eigen::Matrix<double, Rows, Columns> random_matrix(Random& random) {
  return Eigen::Matrix<double, Rows, Columns>::NullaryExpr([&] { return random.normal(); });
}

/// Positive definite, with a condition number below 1e4.
template <int Size>
Eigen::Matrix<double, Size, Size> random_covariance(Random& random) {
  const auto A = random_matrix<Size, Size>(random);
  return A * A.transpose() + 0.1 * Eigen::Matrix<double, Size, Size>::Identity();
}

TEST(Cholesky, InvertsLowerTriangles) {
  Random random(1);
  for (int i = 0; i < 100; ++i) {
    const Matrix5d L = factor_of(random_covariance<5>(random));
    const Matrix5d inverse = inverse_of_lower(L);
    EXPECT_TRUE((L * inverse).isIdentity(1e-9));
    EXPECT_TRUE((inverse * L).isIdentity(1e-9));
    EXPECT_TRUE(Matrix5d(inverse.triangularView<Eigen::StrictlyUpper>()).isZero(0.0));
  }
}

TEST(Cholesky, InvertsPositiveDefiniteMatricesByTheirLowerTriangle) {
  Random random(2);
  for (int i = 0; i < 100; ++i) {
    const Matrix5d S = random_covariance<5>(random);
    const Matrix5d inverse = inverse_of_positive_definite(Matrix5d(S.triangularView<Eigen::Lower>()));
    EXPECT_TRUE((S * inverse).isIdentity(1e-9));
    EXPECT_EQ(inverse, Matrix5d(inverse.transpose())) << "symmetric, bit for bit";
  }
}

// Eigen's LLT is the oracle.
template <int Size, int Columns>
void expect_solutions_of_eigen(Random& random) {
  for (int i = 0; i < 20; ++i) {
    const auto S = random_covariance<Size>(random);
    const auto B = random_matrix<Size, Columns>(random);
    const Eigen::LLT<Eigen::Matrix<double, Size, Size>> oracle(S);
    const Eigen::Matrix<double, Size, Size> L = oracle.matrixL();
    EXPECT_TRUE(factor_of(S).isApprox(L, 1e-12));
    const Eigen::Matrix<double, Size, Columns> lower = oracle.matrixL().solve(B), both = oracle.solve(B);
    EXPECT_TRUE(solve_lower(L, B).isApprox(lower, 1e-10));
    EXPECT_TRUE(solve_cholesky(L, B).isApprox(both, 1e-10));
  }
}

TEST(Cholesky, SolvesAsEigenDoes) {
  Random random(3);
  expect_solutions_of_eigen<1, 1>(random);
  expect_solutions_of_eigen<2, 9>(random);
  expect_solutions_of_eigen<3, 18>(random);
  expect_solutions_of_eigen<5, 1>(random);
  expect_solutions_of_eigen<8, 3>(random);
}

TEST(Cholesky, HasNoInverseOfWhatIsNotPositiveDefinite) {
  Matrix5d S = Matrix5d::Identity();
  S(3, 3) = -1.0;
  EXPECT_TRUE(inverse_of_positive_definite(S).array().isNaN().all());
  EXPECT_TRUE(inverse_of_positive_definite(Matrix5d(Matrix5d::Zero())).array().isNaN().all());
}

}  // namespace
}  // namespace situation_awareness::cholesky_test

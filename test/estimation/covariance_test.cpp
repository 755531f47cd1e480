// SPDX-License-Identifier: BSD-3-Clause
#include "situation_awareness/estimation/covariance.hpp"

#include <gtest/gtest.h>

#include <limits>

#include "situation_awareness/common/random.hpp"
#include "support/random_gaussian.hpp"

namespace situation_awareness {
namespace {

Eigen::Matrix2d matrix(double xx, double xy, double yx, double yy) {
  Eigen::Matrix2d m;
  m << xx, xy, yx, yy;
  return m;
}

TEST(Covariance, IsPositiveSemidefiniteOrNone) {
  const double nan = std::numeric_limits<double>::quiet_NaN(), inf = std::numeric_limits<double>::infinity();
  EXPECT_TRUE(is_positive_semidefinite(Eigen::Matrix3d::Identity()));
  EXPECT_TRUE(is_positive_semidefinite(Eigen::Matrix3d::Zero()));
  EXPECT_TRUE(is_positive_semidefinite(matrix(1.0, 1.0, 1.0, 1.0))) << "singular";
  EXPECT_TRUE(is_positive_semidefinite(1e-300 * matrix(2.0, 1.0, 1.0, 2.0)));
  EXPECT_TRUE(is_positive_semidefinite(1e300 * matrix(2.0, 1.0, 1.0, 2.0)));
  EXPECT_FALSE(is_positive_semidefinite(matrix(2.25, 3.0, 3.0, 2.25)));
  EXPECT_FALSE(is_positive_semidefinite(1e300 * matrix(2.25, 3.0, 3.0, 2.25)));
  EXPECT_FALSE(is_positive_semidefinite(matrix(0.0, 1.0, 1.0, 0.0))) << "LDLT says that it is positive";
  EXPECT_FALSE(is_positive_semidefinite(matrix(1.0, 0.5, 0.0, 1.0))) << "not symmetric";
  EXPECT_FALSE(is_positive_semidefinite(-Eigen::Matrix3d::Identity()));
  EXPECT_FALSE(is_positive_semidefinite(matrix(1.0, nan, nan, 1.0)));
  EXPECT_FALSE(is_positive_semidefinite(Eigen::Matrix3d::Constant(nan))) << "LLT says Success";
  EXPECT_FALSE(is_positive_semidefinite(matrix(inf, 0.0, 0.0, 1.0)));
}

TEST(Covariance, OfAnySizeAndRank) {
  Random random(1);
  for (int i = 0; i < 200; ++i) {
    const int rank = 1 + i % 6;
    Eigen::Matrix<double, 6, 6> A;
    for (int k = 0; k < 6; ++k) A.col(k) = normal_vector<6>(random);
    A.rightCols(6 - rank).setZero();
    Eigen::Matrix<double, 6, 6> C = A * A.transpose();
    EXPECT_TRUE(is_positive_semidefinite(C)) << i;
    // With one direction of a negative variance.
    const Eigen::Matrix<double, 6, 1> d = normal_vector<6>(random).normalized();
    C -= (1e-3 * C.trace() + d.dot(C * d)) * d * d.transpose();
    EXPECT_FALSE(is_positive_semidefinite(C)) << i;
  }
}

}  // namespace
}  // namespace situation_awareness

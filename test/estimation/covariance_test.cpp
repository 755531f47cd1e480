// SPDX-License-Identifier: BSD-3-Clause
#include "situation_awareness/estimation/covariance.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <limits>

#include "situation_awareness/common/random.hpp"
#include "support/random_gaussian.hpp"

namespace situation_awareness::covariance_test {
namespace {

constexpr double kNan = std::numeric_limits<double>::quiet_NaN(), kInf = std::numeric_limits<double>::infinity();

Eigen::Matrix2d matrix(double xx, double xy, double yx, double yy) {
  Eigen::Matrix2d m;
  m << xx, xy, yx, yy;
  return m;
}

TEST(Covariance, IsPositiveSemidefiniteOrNone) {
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
  EXPECT_FALSE(is_positive_semidefinite(matrix(1.0, kNan, kNan, 1.0)));
  EXPECT_FALSE(is_positive_semidefinite(Eigen::Matrix3d::Constant(kNan))) << "LLT says Success";
  EXPECT_FALSE(is_positive_semidefinite(matrix(kInf, 0.0, 0.0, 1.0)));
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

// For any A, A A^T is a covariance, of any scale; a matrix with a negative eigenvalue is none.
TEST(Covariance, OfAnyUnits) {
  Random random(1);
  for (int n = 0; n < 1000; ++n) {
    Eigen::Matrix3d A;
    for (int i = 0; i < 9; ++i) A(i / 3, i % 3) = random.normal();
    const double scale = std::pow(10.0, random.uniform(-12.0, 12.0));
    const Eigen::Vector3d units(1.0, std::pow(10.0, random.uniform(-3.0, 3.0)), 1e-3);
    const Eigen::Matrix3d P = scale * (units.asDiagonal() * A * A.transpose() * units.asDiagonal());
    EXPECT_TRUE(is_positive_semidefinite(P)) << P;
    const Eigen::Vector3d v = Eigen::Vector3d(random.normal(), random.normal(), random.normal()).normalized();
    const Eigen::Matrix3d indefinite = Eigen::Matrix3d::Identity() - 1.5 * v * v.transpose();
    EXPECT_FALSE(is_positive_semidefinite(scale * indefinite)) << indefinite;
  }
  EXPECT_TRUE(is_positive_semidefinite(Eigen::Matrix3d::Zero()));
  EXPECT_TRUE(is_positive_semidefinite(Eigen::Matrix3d::Constant(1e-4))) << "of rank 1";
}

TEST(Covariance, OfAPoseOrNone) {
  for (const double value : {kNan, kInf, -kInf, -1.0, -1e-30}) {
    for (int i = 0; i < 9; ++i) {
      Eigen::Matrix3d P = 1e-4 * Eigen::Matrix3d::Identity();
      P(i / 3, i % 3) = value;
      if (i / 3 == i % 3 || !(std::abs(value) < 1.0)) {
        EXPECT_FALSE(is_positive_semidefinite(P)) << P;
      }
    }
  }
  Eigen::Matrix3d P = Eigen::Matrix3d::Zero();
  P(0, 1) = P(1, 0) = 1.0;
  EXPECT_FALSE(is_positive_semidefinite(P));
  P << 2.25, 3.0, 0.0, 3.0, 2.25, 0.0, 0.0, 0.0, 1.0;
  EXPECT_FALSE(is_positive_semidefinite(P));
  P << 2.25, 1.0, 0.0, -1.0, 2.25, 0.0, 0.0, 0.0, 1.0;
  EXPECT_FALSE(is_positive_semidefinite(P)) << "not symmetric";
}

}  // namespace
}  // namespace situation_awareness::covariance_test

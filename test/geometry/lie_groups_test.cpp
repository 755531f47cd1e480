// SPDX-License-Identifier: BSD-3-Clause
#include "situation_awareness/geometry/lie_groups.hpp"

#include <gtest/gtest.h>

#include <cmath>

#include <Eigen/Core>
#include <Eigen/Geometry>
#include <unsupported/Eigen/MatrixFunctions>

#include "situation_awareness/common/random.hpp"
#include "support/numerical_jacobian.hpp"
#include "support/random_gaussian.hpp"

namespace situation_awareness::lie_groups_test {
namespace {

/// A tangent vector that turns by less than half a turn; every third by next to nothing.
Eigen::Vector3d random_se2_tangent(Random& random, int i) {
  const double scale = i % 3 == 0 ? std::pow(10.0, random.uniform(-12.0, -1.0)) : 1.0;
  return {random.uniform(-5.0, 5.0), random.uniform(-5.0, 5.0), scale * random.uniform(-0.999 * kPi, 0.999 * kPi)};
}

Eigen::Vector3d random_so3_tangent(Random& random, int i) {
  const double scale = i % 3 == 0 ? std::pow(10.0, random.uniform(-12.0, -1.0)) : 1.0;
  return scale * random.uniform(0.0, 0.999 * kPi) * normal_vector<3>(random).normalized();
}

double distance(const Pose2& a, const Pose2& b) {
  return (a.translation_m - b.translation_m).norm() + std::abs(wrap_to_pi(a.yaw_rad - b.yaw_rad));
}

TEST(SeriesFactors, AreSmoothThroughZero) {
  for (const double a : {0.0, 1e-300, 1e-12, 1e-8, 1e-4, 0.0999, 0.1001, 0.5, 3.0}) {
    for (const double signed_a : {a, -a}) {
      const long double x = signed_a;
      // Taylor's series in extended precision, which converges for all of these.
      long double sine = 0.0L;
      long double cosine = 0.0L;
      long double defect = 0.0L;
      long double power = 1.0L;      // (-x^2)^k
      long double factorial = 1.0L;  // (2 k)!
      for (int k = 0; k < 30; ++k) {
        sine += power / (factorial * (2 * k + 1));
        cosine += power / (factorial * (2 * k + 1) * (2 * k + 2));
        defect += power / (factorial * (2 * k + 1) * (2 * k + 2) * (2 * k + 3));
        power *= -x * x;
        factorial *= (2 * k + 1) * (2 * k + 2);
      }
      EXPECT_NEAR(sinc(signed_a), static_cast<double>(sine), 1e-15) << signed_a;
      EXPECT_NEAR(one_minus_cos_over_square(signed_a), static_cast<double>(cosine), 1e-15) << signed_a;
      EXPECT_NEAR(angle_minus_sin_over_cube(signed_a), static_cast<double>(defect), 1e-13) << signed_a;
    }
  }
}

TEST(Se2, LogUndoesExp) {
  Random random(1);
  for (int i = 0; i < 300; ++i) {
    const Eigen::Vector3d tau = random_se2_tangent(random, i);
    EXPECT_LT((log_se2(exp_se2(tau)) - tau).norm(), 1e-12) << tau.transpose();
    const Pose2 T{{random.uniform(-5.0, 5.0), random.uniform(-5.0, 5.0)}, random.uniform(-20.0, 20.0)};
    EXPECT_LT(distance(exp_se2(log_se2(T)), T), 1e-12);
  }
}

TEST(Se2, ExpIsTheMatrixExponential) {
  Random random(2);
  for (int i = 0; i < 300; ++i) {
    const Eigen::Vector3d tau = random_se2_tangent(random, i);
    Eigen::Matrix3d A;
    A << 0.0, -tau(2), tau(0), tau(2), 0.0, tau(1), 0.0, 0.0, 0.0;
    const Eigen::Matrix3d expected = A.exp();
    const Pose2 T = exp_se2(tau);
    EXPECT_LT((T.rotation() - expected.topLeftCorner<2, 2>()).norm(), 1e-12);
    EXPECT_LT((T.translation_m - expected.topRightCorner<2, 1>()).norm(), 1e-12);
  }
}

TEST(Se2, AQuarterOfACircleEndsWhereItDoes) {
  const Pose2 T = exp_se2({kPi / 2.0 * 3.0, 0.0, kPi / 2.0});  // to the left, with a radius of 3 m
  EXPECT_LT(distance(T, {{3.0, 3.0}, kPi / 2.0}), 1e-15);
}

TEST(Se2, AdjointCarriesAMotionIntoTheOtherFrame) {
  Random random(3);
  for (int i = 0; i < 100; ++i) {
    const Pose2 T{{random.uniform(-5.0, 5.0), random.uniform(-5.0, 5.0)}, random.uniform(-kPi, kPi)};
    const Eigen::Vector3d tau = random_se2_tangent(random, i);
    EXPECT_LT(distance(T * exp_se2(tau), exp_se2(adjoint_se2(T) * tau) * T), 1e-11);
  }
}

TEST(Se2, RightJacobianEqualsTheNumericalOne) {
  Random random(4);
  for (int i = 0; i < 100; ++i) {
    const Eigen::Vector3d tau = random_se2_tangent(random, i);
    const Pose2 T = exp_se2(tau);
    const auto J =
        numerical_jacobian<3, 3>([&](const Eigen::Vector3d& at) { return log_se2(inverse(T) * exp_se2(at)); }, tau);
    EXPECT_LT((J - right_jacobian_se2(tau)).cwiseAbs().maxCoeff(), 1e-8) << tau.transpose();
  }
}

TEST(So3, LogUndoesExp) {
  Random random(5);
  for (int i = 0; i < 300; ++i) {
    const Eigen::Vector3d phi = random_so3_tangent(random, i);
    EXPECT_LT((log_so3(exp_so3(phi)) - phi).norm(), 1e-12 * (1.0 + phi.norm())) << phi.transpose();
    EXPECT_NEAR(exp_so3(phi).norm(), 1.0, 1e-15);
    const Eigen::Quaterniond minus(-exp_so3(phi).coeffs());  // the same rotation
    EXPECT_LT((log_so3(minus) - phi).norm(), 1e-12 * (1.0 + phi.norm()));
  }
  EXPECT_EQ(log_so3(Eigen::Quaterniond::Identity()).norm(), 0.0);
  EXPECT_NEAR(log_so3(exp_so3({0.0, kPi, 0.0})).norm(), kPi, 1e-15);
}

TEST(So3, ExpIsTheMatrixExponential) {
  Random random(6);
  for (int i = 0; i < 300; ++i) {
    const Eigen::Vector3d phi = random_so3_tangent(random, i);
    EXPECT_LT((exp_so3(phi).toRotationMatrix() - hat(phi).exp()).norm(), 1e-12);
  }
}

TEST(So3, HatIsTheCrossProduct) {
  Random random(7);
  const auto a = normal_vector<3>(random);
  const auto b = normal_vector<3>(random);
  EXPECT_LT((hat(a) * b - a.cross(b)).norm(), 1e-15);
}

TEST(So3, RightJacobianEqualsTheNumericalOne) {
  Random random(8);
  for (int i = 0; i < 100; ++i) {
    const Eigen::Vector3d phi = random_so3_tangent(random, i);
    const Eigen::Quaterniond q = exp_so3(phi);
    const auto J =
        numerical_jacobian<3, 3>([&](const Eigen::Vector3d& at) { return log_so3(q.conjugate() * exp_so3(at)); }, phi);
    EXPECT_LT((J - right_jacobian_so3(phi)).cwiseAbs().maxCoeff(), 1e-8) << phi.transpose();
  }
}

}  // namespace
}  // namespace situation_awareness::lie_groups_test

// SPDX-License-Identifier: BSD-3-Clause
#include "situation_awareness/geometry/ellipse.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <utility>
#include <vector>

#include <Eigen/Cholesky>
#include <Eigen/Eigenvalues>

#include "situation_awareness/common/random.hpp"
#include "situation_awareness/geometry/angles.hpp"
#include "situation_awareness/geometry/ellipses_by_x.hpp"

namespace situation_awareness {
namespace {

Ellipse random_ellipse(Random& random) {
  return {{random.uniform(-5.0, 5.0), random.uniform(-5.0, 5.0)},
          random.uniform(-10.0, 10.0),
          random.uniform(0.05, 0.5),
          random.uniform(0.05, 0.5)};
}

Pose2 random_pose(Random& random) {
  return {{random.uniform(-5.0, 5.0), random.uniform(-5.0, 5.0)}, random.uniform(-10.0, 10.0)};
}

Eigen::Vector2d point_on(const Ellipse& ellipse, double angle_rad) {
  return ellipse.center_m + Eigen::Rotation2Dd(ellipse.psi_rad) *
                                Eigen::Vector2d(ellipse.rx_m * std::cos(angle_rad), ellipse.ry_m * std::sin(angle_rad));
}

TEST(Pose2, InverseUndoesAndCompositionChains) {
  Random random(1);
  for (int i = 0; i < 100; ++i) {
    const Pose2 T_a_b = random_pose(random);
    const Pose2 T_b_c = random_pose(random);
    const Eigen::Vector2d p(random.normal(), random.normal());
    EXPECT_LT((inverse(T_a_b) * (T_a_b * p) - p).norm(), 1e-12);
    EXPECT_LT(((T_a_b * T_b_c) * p - T_a_b * (T_b_c * p)).norm(), 1e-12);
  }
}

TEST(Ellipse, CanonicalIsTheSameCurveWithOrderedRadii) {
  Random random(2);
  for (int i = 0; i < 100; ++i) {
    const Ellipse ellipse = random_ellipse(random);
    const Ellipse c = canonical(ellipse);
    EXPECT_GE(c.rx_m, c.ry_m);
    EXPECT_LE(std::abs(c.psi_rad), kPi / 2.0);
    EXPECT_LT((shape_matrix(c) - shape_matrix(ellipse)).norm(), 1e-12);
  }
}

TEST(Ellipse, ShapeMatrixDescribesTheCurve) {
  Random random(3);
  for (int i = 0; i < 100; ++i) {
    const Ellipse ellipse = random_ellipse(random);
    const Eigen::Vector2d d = point_on(ellipse, random.uniform(0.0, 2.0 * kPi)) - ellipse.center_m;
    EXPECT_NEAR(d.dot(shape_matrix(ellipse).inverse() * d), 1.0, 1e-9);
  }
}

TEST(Ellipse, RigidMotionMovesEveryPointOfTheCurve) {
  Random random(4);
  for (int i = 0; i < 100; ++i) {
    const Ellipse ellipse_b = random_ellipse(random);
    const Pose2 T_a_b = random_pose(random);
    const double angle_rad = random.uniform(0.0, 2.0 * kPi);
    EXPECT_LT((point_on(T_a_b * ellipse_b, angle_rad) - T_a_b * point_on(ellipse_b, angle_rad)).norm(), 1e-9);
  }
}

TEST(Ellipse, RayMeetsTheCurveAtItsNearerCrossing) {
  Random random(5);
  for (int i = 0; i < 200; ++i) {
    const Ellipse ellipse = random_ellipse(random);
    const Eigen::Vector2d target = point_on(ellipse, random.uniform(0.0, 2.0 * kPi));
    const Eigen::Vector2d origin(20.0 * std::cos(i), 20.0 * std::sin(i));
    const double distance = (target - origin).norm();
    const auto hit = intersect_ray(ellipse, origin, (target - origin) / distance);
    // A tangent ray may miss by rounding.
    if (!hit) continue;
    const Eigen::Vector2d p = origin + *hit * (target - origin) / distance;
    EXPECT_LE(*hit, distance + 1e-6);
    const Eigen::Vector2d d = p - ellipse.center_m;
    EXPECT_NEAR(d.dot(shape_matrix(ellipse).inverse() * d), 1.0, 1e-6);
  }
}

TEST(Ellipse, RayAwayMissesAndRayFromInsideLeaves) {
  const Ellipse ellipse{{2.0, 0.0}, 0.0, 0.5, 0.2};
  EXPECT_NEAR(intersect_ray(ellipse, {0.0, 0.0}, {1.0, 0.0}).value(), 1.5, 1e-12);
  EXPECT_FALSE(intersect_ray(ellipse, {0.0, 0.0}, {-1.0, 0.0}).has_value());
  EXPECT_FALSE(intersect_ray(ellipse, {0.0, 0.3}, {1.0, 0.0}).has_value());
  EXPECT_NEAR(intersect_ray(ellipse, {2.0, 0.0}, {0.0, 1.0}).value(), 0.2, 1e-12);
}

TEST(Ellipse, CharacteristicDistanceIsAMetricOnDescriptionsAndTheSymmetricOneOnCurves) {
  Random random(6);
  for (int i = 0; i < 100; ++i) {
    const Ellipse a = random_ellipse(random);
    const Ellipse b = random_ellipse(random);
    const Pose2 T = random_pose(random);
    EXPECT_NEAR(characteristic_distance(a, a), 0.0, 1e-12);
    EXPECT_NEAR(characteristic_distance(T * a, T * b), characteristic_distance(a, b), 1e-9);
    Ellipse turned = b;
    turned.psi_rad += kPi;
    EXPECT_NEAR(symmetric_characteristic_distance(a, turned), symmetric_characteristic_distance(a, b), 1e-9);
    EXPECT_LE(symmetric_characteristic_distance(a, b), characteristic_distance(a, b) + 1e-12);
  }
  // Moved by d, every characteristic point moves by d.
  const Ellipse a{{1.0, 2.0}, 0.3, 0.4, 0.2};
  Ellipse moved = a;
  moved.center_m += Eigen::Vector2d(0.03, 0.04);
  EXPECT_NEAR(characteristic_distance(a, moved), 0.05, 1e-12);
}

TEST(Ellipse, ContainsItsInsideOnly) {
  const Ellipse ellipse{{1.0, 1.0}, kPi / 2.0, 0.5, 0.1};
  EXPECT_TRUE(contains(ellipse, {1.0, 1.45}));
  EXPECT_FALSE(contains(ellipse, {1.15, 1.0}));
}

TEST(EllipsesByX, CoverWhatAnyOfThemContains) {
  Random random(7);
  std::vector<Ellipse> ellipses;
  for (int i = 0; i < 60; ++i) ellipses.push_back(random_ellipse(random));
  const EllipsesByX by_x(ellipses);
  int covered = 0;
  for (int i = 0; i < 2000; ++i) {
    const Eigen::Vector2d point(random.uniform(-6.0, 6.0), random.uniform(-6.0, 6.0));
    const bool any =
        std::any_of(ellipses.begin(), ellipses.end(), [&](const Ellipse& e) { return contains(e, point); });
    EXPECT_EQ(by_x.cover(point), any);
    covered += any ? 1 : 0;
  }
  EXPECT_GT(covered, 100);
  EXPECT_FALSE(EllipsesByX({}).cover({0.0, 0.0}));
}

TEST(SmoothParameters, RoundTripAndAreTheSameForEveryDescription) {
  Random random(1);
  for (int i = 0; i < 200; ++i) {
    const Ellipse ellipse = canonical(random_ellipse(random));
    const Ellipse back = ellipse_from_smooth_parameters(smooth_parameters(ellipse));
    EXPECT_LT(symmetric_characteristic_distance(ellipse, back), 1e-9);
    Ellipse turned = ellipse;
    turned.psi_rad += kPi / 2.0;
    std::swap(turned.rx_m, turned.ry_m);
    EXPECT_LT((smooth_parameters(turned) - smooth_parameters(ellipse)).norm(), 1e-9);
  }
}

TEST(EllipseCovariance, EqualsThatOfManyDraws) {
  Random random(2);
  const Ellipse ellipse{{2.0, 1.0}, 0.4, 0.4, 0.15};
  Matrix5d covariance = Matrix5d::Zero();
  Matrix5d L = Matrix5d::Zero();
  for (int i = 0; i < 5; ++i) {
    for (int j = 0; j <= i; ++j) L(i, j) = 0.003 * random.normal();
  }
  const Matrix5d smooth_covariance = L * L.transpose() + 1e-8 * Matrix5d::Identity();
  const Matrix5d root = smooth_covariance.llt().matrixL();
  const int draws = 20000;
  for (int i = 0; i < draws; ++i) {
    Vector5d normal;
    for (int k = 0; k < 5; ++k) normal(k) = random.normal();
    const Ellipse draw = ellipse_from_smooth_parameters(smooth_parameters(ellipse) + root * normal);
    Vector5d error;
    error << draw.center_m - ellipse.center_m, wrap_to_half_pi(draw.psi_rad - ellipse.psi_rad),
        draw.rx_m - ellipse.rx_m, draw.ry_m - ellipse.ry_m;
    covariance += error * error.transpose() / draws;
  }
  const Matrix5d predicted = ellipse_covariance(ellipse, smooth_covariance);
  EXPECT_LT((covariance - predicted).norm(), 0.05 * predicted.norm());
}

TEST(EllipseCovariance, OfACircleIsFiniteAndItsAxisUnknown) {
  const Matrix5d covariance = ellipse_covariance({{2.0, 0.0}, 0.0, 0.2, 0.2}, 1e-4 * Matrix5d::Identity());
  EXPECT_TRUE(covariance.allFinite());
  EXPECT_NEAR(std::sqrt(covariance(2, 2)), kPi / std::sqrt(12.0), 1e-9);
  EXPECT_GT(Eigen::SelfAdjointEigenSolver<Matrix5d>(covariance).eigenvalues().minCoeff(), 0.0);
}

}  // namespace
}  // namespace situation_awareness

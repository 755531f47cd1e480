// SPDX-License-Identifier: BSD-3-Clause
#include "situation_awareness/geometry/ellipse.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <utility>
#include <vector>

#include <Eigen/LU>

#include "situation_awareness/common/random.hpp"
#include "situation_awareness/geometry/angles.hpp"
#include "situation_awareness/geometry/ellipses_by_x.hpp"
#include "support/numerical_jacobian.hpp"
#include "support/random_gaussian.hpp"

namespace situation_awareness::ellipse_test {
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

TEST(Ellipse, PointsOnItAreOnTheCurveAndCounterClockwise) {
  Random random(11);
  for (int i = 0; i < 100; ++i) {
    const Ellipse ellipse = random_ellipse(random);
    const std::vector<Eigen::Vector2d> points = points_on(ellipse, 17);
    ASSERT_EQ(points.size(), 17u);
    const Eigen::Matrix2d C_inverse = shape_matrix(ellipse).inverse();
    double area_m2 = 0.0;
    for (std::size_t k = 0; k < points.size(); ++k) {
      const Eigen::Vector2d d = points[k] - ellipse.center_m;
      const Eigen::Vector2d next = points[(k + 1) % points.size()] - ellipse.center_m;
      EXPECT_NEAR(d.dot(C_inverse * d), 1.0, 1e-9);
      area_m2 += 0.5 * (d.x() * next.y() - d.y() * next.x());
    }
    // Of the inscribed polygon at equal steps of the parameter: n / 2 sin(2 pi / n) rx ry.
    EXPECT_NEAR(area_m2, 8.5 * std::sin(2.0 * kPi / 17.0) * ellipse.rx_m * ellipse.ry_m, 1e-12);
    EXPECT_LT((points[0] - characteristic_points(ellipse)[0]).norm(), 1e-12);
  }
}

TEST(Ellipse, OffsetIsTheDistanceOfTheNearestPoint) {
  Random random(12);
  for (int i = 0; i < 300; ++i) {
    Ellipse ellipse = random_ellipse(random);
    if (i % 3 == 0) ellipse.ry_m = 0.1 * ellipse.rx_m;
    if (i % 3 == 1) ellipse.ry_m = ellipse.rx_m;
    const Eigen::Vector2d p = ellipse.center_m + Eigen::Vector2d(random.uniform(-1.0, 1.0), random.uniform(-1.0, 1.0));
    double nearest_m = std::numeric_limits<double>::infinity();
    for (int k = 0; k < 20000; ++k) {
      nearest_m = std::min(nearest_m, (point_on(ellipse, 2.0 * kPi * k / 20000.0) - p).norm());
    }
    EXPECT_NEAR(offset_m(ellipse, p), contains(ellipse, p) ? -nearest_m : nearest_m, 2e-4);
  }
}

TEST(Ellipse, OffsetOfThePointsOfSymmetry) {
  const Ellipse ellipse{{1.0, 2.0}, 0.4, 0.5, 0.2};
  EXPECT_NEAR(offset_m(ellipse, ellipse.center_m), -0.2, 1e-6);
  for (const Eigen::Vector2d& end : characteristic_points(ellipse)) {
    EXPECT_NEAR(offset_m(ellipse, end), 0.0, 1e-6);
    const Eigen::Vector2d out = (end - ellipse.center_m).normalized();
    EXPECT_NEAR(offset_m(ellipse, end + 0.3 * out), 0.3, 1e-6);
    EXPECT_NEAR(offset_m(ellipse, end - 0.05 * out), -0.05, 1e-6);
  }
  EXPECT_NEAR(offset_m(Ellipse{{0.0, 0.0}, 0.0, 0.3, 0.3}, {0.0, 0.0}), -0.3, 1e-9);
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

TEST(Ellipse, RayHitsTheCurveAtItsNearerCrossing) {
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
  EXPECT_FALSE(EllipsesByX().cover({0.0, 0.0}));
}

// Circles, with an analytic solution: at a distance d, radii r of the one asked for and R of the other, r + R - d
// of its width 2 r lies on the other.
TEST(EllipsesByX, AnEllipseIsNotCoveredByItselfOrASmallerOne) {
  const Ellipse small{{0.1, 0.0}, 0.0, 0.3, 0.2};
  const Ellipse large{{0.0, 0.0}, 0.0, 0.8, 0.3};
  const EllipsesByX by_x({large, small, {{20.0, 0.0}, 0.0, 5.0, 5.0}});
  EXPECT_TRUE(by_x.cover_by_larger(small));
  EXPECT_FALSE(by_x.cover_by_larger(large));
  EXPECT_FALSE(by_x.cover_by_larger({{0.0, 0.4}, 0.0, 0.3, 0.2}));
}

TEST(EllipsesByX, OverlapEllipsesByMoreThanAQuarterOfTheirWidth) {
  Random random(8);
  for (int i = 0; i < 500; ++i) {
    const Ellipse other{{random.uniform(-5.0, 5.0), random.uniform(-5.0, 5.0)}, 0.0, 0.4, 0.4};
    const EllipsesByX by_x(std::vector<Ellipse>{{{-20.0, 0.0}, 0.0, 0.1, 0.1}, other, {{20.0, 0.0}, 0.0, 0.1, 0.1}});
    const double r_m = random.uniform(0.05, 1.0);
    const double distance_m = random.uniform(0.0, 2.0);
    const double direction_rad = random.uniform(-kPi, kPi);
    const Eigen::Vector2d center_m =
        other.center_m + distance_m * Eigen::Vector2d(std::cos(direction_rad), std::sin(direction_rad));
    EXPECT_EQ(by_x.overlap({center_m, 0.0, r_m, r_m}), r_m + 0.4 - distance_m > 0.25 * 2.0 * r_m) << i;
  }
  // Along the line of centres the half widths are those of the ellipses.
  const EllipsesByX by_x(std::vector<Ellipse>{{{0.0, 0.0}, 0.0, 0.5, 0.1}});
  EXPECT_TRUE(by_x.overlap({{0.59, 0.0}, kPi / 2.0, 0.6, 0.2}));
  EXPECT_FALSE(by_x.overlap({{0.61, 0.0}, kPi / 2.0, 0.6, 0.2}));
  EXPECT_TRUE(by_x.overlap({{0.0, 0.39}, kPi / 2.0, 0.6, 0.2}));
  EXPECT_FALSE(by_x.overlap({{0.0, 0.41}, kPi / 2.0, 0.6, 0.2}));
  EXPECT_TRUE(by_x.overlap({{0.0, 0.0}, 0.0, 0.1, 0.1}));
  EXPECT_FALSE(EllipsesByX().overlap({{0.0, 0.0}, 0.0, 0.1, 0.1}));
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

TEST(SmoothParameters, JacobiansOfPsiAndRadiiEqualNumericalOnes) {
  Random random(2);
  for (int i = 0; i < 200; ++i) {
    Ellipse ellipse = canonical(random_ellipse(random));
    if (ellipse.rx_m - ellipse.ry_m < 0.02) continue;
    // Not beside the seam of psi, where numerical differences jump.
    if (std::abs(ellipse.psi_rad) > 1.5) ellipse.psi_rad = 0.3;
    const Vector5d smooth = smooth_parameters(ellipse);
    const auto at = [&](const Eigen::Vector3d& shape) {
      Vector5d parameters = smooth;
      parameters.tail<3>() = shape;
      return ellipse_from_smooth_parameters(parameters);
    };
    const auto J = numerical_jacobian<3, 3>(
        [&](const Eigen::Vector3d& shape) {
          const Ellipse e = at(shape);
          return Eigen::Vector3d(e.psi_rad, e.rx_m, e.ry_m);
        },
        Eigen::Vector3d(smooth.tail<3>()));
    EXPECT_LT((J.topRows<1>() - psi_jacobian(ellipse)).norm(), 1e-6 * psi_jacobian(ellipse).norm());
    EXPECT_LT((J.bottomRows<2>() - radii_jacobian(ellipse)).norm(), 1e-5);
    // Every description of the curve has the same axis and so the same derivative.
    Ellipse turned = ellipse;
    turned.psi_rad += kPi;
    EXPECT_LT((psi_jacobian(turned) - psi_jacobian(ellipse)).norm(), 1e-9);
  }
}

TEST(SmoothParameters, JacobiansTransformACovarianceAsManyDrawsDo) {
  Random random(3);
  const Ellipse ellipse{{2.0, 1.0}, 0.4, 0.4, 0.15};
  const auto smooth_covariance = random_covariance<Matrix5d>(random, 0.003);
  Eigen::Matrix3d J;
  J << psi_jacobian(ellipse), radii_jacobian(ellipse);
  const Eigen::Matrix3d predicted = J * smooth_covariance.bottomRightCorner<3, 3>() * J.transpose();
  Eigen::Matrix3d covariance = Eigen::Matrix3d::Zero();
  const int draws = 20000;
  for (int i = 0; i < draws; ++i) {
    const Ellipse drawn = ellipse_from_smooth_parameters(smooth_parameters(ellipse) + draw(smooth_covariance, random));
    const Eigen::Vector3d error(wrap_to_half_pi(drawn.psi_rad - ellipse.psi_rad), drawn.rx_m - ellipse.rx_m,
                                drawn.ry_m - ellipse.ry_m);
    covariance += error * error.transpose() / draws;
  }
  EXPECT_LT((covariance - predicted).norm(), 0.05 * predicted.norm());
}

TEST(SmoothParameters, ACircleHasFiniteDerivativesAndAnUnknownAxis) {
  const Ellipse circle{{2.0, 0.0}, 0.0, 0.2, 0.2};
  EXPECT_TRUE(psi_jacobian(circle).allFinite());
  EXPECT_TRUE(radii_jacobian(circle).allFinite());
  const Eigen::Matrix3d covariance = 1e-4 * Eigen::Matrix3d::Identity();
  EXPECT_GT(psi_jacobian(circle) * covariance * psi_jacobian(circle).transpose(), kUniformAxisVariance);
}

TEST(SmoothParameters, TheVarianceOfAnUnknownAxisIsThatOfUniformDraws) {
  Random random(4);
  double variance = 0.0;
  const int draws = 100000;
  for (int i = 0; i < draws; ++i) variance += std::pow(random.uniform(-kPi / 2.0, kPi / 2.0), 2) / draws;
  EXPECT_NEAR(variance, kUniformAxisVariance, 0.01);
}

}  // namespace
}  // namespace situation_awareness::ellipse_test

// SPDX-License-Identifier: BSD-3-Clause
#include "situation_awareness/geometry/curve.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <limits>

#include "situation_awareness/common/random.hpp"
#include "situation_awareness/geometry/angles.hpp"
#include "situation_awareness/geometry/vectors.hpp"

namespace situation_awareness::curve_test {
namespace {

/// Lines and arcs, of up to nearly a full turn.
Curve random_curve(Random& random) {
  const double yaw_rad = random.uniform(-kPi, kPi);
  Curve curve{{random.uniform(-8.0, 8.0), random.uniform(-8.0, 8.0)},
              {std::cos(yaw_rad), std::sin(yaw_rad)},
              random.uniform() < 0.3 ? 0.0 : random.uniform(-1.0, 1.0),
              random.uniform(0.1, 12.0)};
  if (curve.curvature_1_m != 0.0) {
    curve.length_m = std::min(curve.length_m, 6.2 / std::abs(curve.curvature_1_m));
  }
  return curve;
}

Curve moved(double yaw_rad, const Eigen::Vector2d& by_m, const Curve& curve) {
  const Eigen::Rotation2Dd R(yaw_rad);
  return {R * curve.from_m + by_m, R * curve.along, curve.curvature_1_m, curve.length_m};
}

TEST(Curve, IsTheArcOfItsBulgeAndOfItsCentre) {
  Random random(1);
  for (int i = 0; i < 1000; ++i) {
    const Eigen::Vector2d a(random.uniform(-5.0, 5.0), random.uniform(-5.0, 5.0));
    const Eigen::Vector2d b(random.uniform(-5.0, 5.0), random.uniform(-5.0, 5.0));
    const double bulge = random.uniform(-3.0, 3.0);
    const Curve curve = curve_with_bulge(a, b, bulge);
    EXPECT_NEAR((point_at(curve, curve.length_m) - b).norm(), 0.0, 1e-9);
    EXPECT_NEAR(curve.curvature_1_m * curve.length_m, 4.0 * std::atan(bulge), 1e-9);
    const Curve of_centre = curve_of(arc_with_bulge(a, b, bulge));
    for (const double part : {0.0, 0.3, 1.0}) {
      EXPECT_NEAR((point_at(curve, part * curve.length_m) - point_at(of_centre, part * of_centre.length_m)).norm(), 0.0,
                  1e-9);
    }
    const Curve part = part_of(curve, 0.2 * curve.length_m, 0.7 * curve.length_m);
    EXPECT_NEAR((point_at(part, 0.5 * part.length_m) - point_at(curve, 0.45 * curve.length_m)).norm(), 0.0, 1e-9);
  }
  const Curve line = curve_with_bulge({1.0, 2.0}, {4.0, 6.0}, 0.0);
  EXPECT_DOUBLE_EQ(line.length_m, 5.0);
  EXPECT_EQ(point_at(line, 5.0), Eigen::Vector2d(4.0, 6.0));
}

TEST(Curve, NearestPointAgreesWithASearch) {
  Random random(2);
  for (int i = 0; i < 2000; ++i) {
    const Curve curve = random_curve(random);
    const Eigen::Vector2d p(random.uniform(-12.0, 12.0), random.uniform(-12.0, 12.0));
    const double way_m = nearest_m(curve, p);
    EXPECT_GE(way_m, 0.0);
    EXPECT_LE(way_m, curve.length_m);
    double least_m = std::numeric_limits<double>::infinity();
    for (int k = 0; k <= 500; ++k) {
      least_m = std::min(least_m, (point_at(curve, curve.length_m * 2e-3 * k) - p).norm());
    }
    EXPECT_LE(distance_m(curve, p), least_m + 1e-9) << i;
    EXPECT_GE(distance_m(curve, p), least_m - 2e-3 * curve.length_m) << i;
  }
}

TEST(Curve, DistanceOfCurvesAgreesWithASearch) {
  Random random(3);
  int met = 0;
  for (int i = 0; i < 3000; ++i) {
    const Curve a = random_curve(random), b = random_curve(random);
    const double exact_m = distance_m(a, b);
    EXPECT_NEAR(distance_m(b, a), exact_m, 1e-9);
    met += exact_m == 0.0 ? 1 : 0;
    double least_m = std::numeric_limits<double>::infinity();
    for (int k = 0; k <= 400; ++k) {
      least_m = std::min(least_m, distance_m(b, point_at(a, a.length_m * 2.5e-3 * k)));
    }
    EXPECT_LE(exact_m, least_m + 1e-9) << i;
    EXPECT_GE(exact_m, least_m - 2.5e-3 * a.length_m) << i;
    const double yaw_rad = random.uniform(-kPi, kPi);
    const Eigen::Vector2d by_m(random.uniform(-50.0, 50.0), random.uniform(-50.0, 50.0));
    EXPECT_NEAR(distance_m(moved(yaw_rad, by_m, a), moved(yaw_rad, by_m, b)), exact_m, 1e-8) << i;
  }
  EXPECT_GT(met, 100);
  EXPECT_LT(met, 2500);
}

// Up to there nothing is nearer, right after it something is; and what is nowhere nearer has no such way.
TEST(Curve, FirstNearerAgreesWithASearch) {
  Random random(4);
  int within = 0, none = 0;
  for (int i = 0; i < 5000; ++i) {
    const Curve a = random_curve(random), b = random_curve(random);
    const double margin_m = random.uniform(0.05, 5.0);
    const std::optional<double> first_m = first_nearer_m(a, b, margin_m);
    if (std::abs(distance_m(a, b) - margin_m) > 1e-6) {
      EXPECT_EQ(first_m.has_value(), distance_m(a, b) < margin_m) << i;
    }
    const double free_m = first_m.value_or(a.length_m);
    if (free_m > 0.0) {
      EXPECT_GE(distance_m(part_of(a, 0.0, free_m), b), margin_m - 1e-6) << i;
    }
    if (first_m && *first_m > 0.0) {
      EXPECT_NEAR(distance_m(b, point_at(a, *first_m)), margin_m, 1e-6) << i;
      ++within;
    }
    none += first_m ? 0 : 1;
  }
  EXPECT_GT(within, 300);
  EXPECT_GT(none, 500);
}

}  // namespace
}  // namespace situation_awareness::curve_test

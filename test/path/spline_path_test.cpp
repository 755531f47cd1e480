// SPDX-License-Identifier: BSD-3-Clause
#include "situation_awareness/path/spline_path.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <vector>

#include "situation_awareness/common/random.hpp"
#include "situation_awareness/geometry/angles.hpp"
#include "support/refusal.hpp"

namespace situation_awareness::spline_path_test {
namespace {

Path winding(bool closed, std::uint64_t seed = 1) {
  Random random(seed);
  Path path{closed, {}};
  for (int i = 0; i < 9; ++i) {
    const double angle = 2.0 * kPi * i / 9.0 + random.uniform(-0.2, 0.2);
    const double radius_m = random.uniform(2.6, 3.4);
    path.way_points.push_back({{radius_m * std::cos(angle), radius_m * std::sin(angle)}, {}});
  }
  return path;
}

Path moved(Path path, const Pose2& T) {
  for (WayPoint& point : path.way_points) point.p_world_m = T * point.p_world_m;
  return path;
}

TEST(SplinePath, LeadsThroughItsWayPoints) {
  for (const bool closed : {false, true}) {
    const Path path = winding(closed);
    const SplinePath spline(path);
    EXPECT_EQ(spline.segments(), closed ? 9U : 8U);
    for (std::size_t i = 0; i < spline.segments(); ++i) {
      EXPECT_LT((spline.at(spline.begin_m(i)).p_world_m - path.way_points[i].p_world_m).norm(), 1e-9);
    }
    const std::size_t end = closed ? 0 : 8;
    EXPECT_LT((spline.at(spline.length_m()).p_world_m - path.way_points[end].p_world_m).norm(), 1e-9);
  }
}

// The numerical derivatives by the way: it is arc length, the tangent is the first one, and curvature that of the yaw.
TEST(SplinePath, YawAndCurvatureAreTheDerivatives) {
  const double h = 1e-4;
  for (const bool closed : {false, true}) {
    const SplinePath spline(winding(closed));
    for (double way_m = 0.05; way_m < spline.length_m() - 0.05; way_m += 0.0173) {
      const PathPoint a = spline.at(way_m - h), b = spline.at(way_m + h), at = spline.at(way_m);
      const Eigen::Vector2d tangent = (b.p_world_m - a.p_world_m) / (2.0 * h);
      EXPECT_NEAR(tangent.norm(), 1.0, 1e-5);
      EXPECT_NEAR(wrap_to_pi(std::atan2(tangent.y(), tangent.x()) - at.yaw_rad), 0.0, 1e-4);
      EXPECT_NEAR(wrap_to_pi(b.yaw_rad - a.yaw_rad) / (2.0 * h), at.curvature_1_m, 5e-3);
    }
  }
}

TEST(SplinePath, HasNoStepAtWayPoints) {
  for (const bool closed : {false, true}) {
    const SplinePath spline(winding(closed));
    for (std::size_t i = closed ? 0 : 1; i < spline.segments(); ++i) {
      const PathPoint a = spline.at(spline.begin_m(i) - 1e-7), b = spline.at(spline.begin_m(i) + 1e-7);
      EXPECT_NEAR(wrap_to_pi(a.yaw_rad - b.yaw_rad), 0.0, 1e-5);
      EXPECT_NEAR(a.curvature_1_m, b.curvature_1_m, 1e-4);
    }
    if (!closed) {
      EXPECT_NEAR(spline.at(0.0).curvature_1_m, 0.0, 1e-9);
      EXPECT_NEAR(spline.at(spline.length_m()).curvature_1_m, 0.0, 1e-9);
    }
  }
}

TEST(SplinePath, OfACircleIsACircle) {
  Path path{true, {}};
  for (int i = 0; i < 16; ++i) {
    path.way_points.push_back({{2.0 * std::cos(kPi * i / 8.0), 2.0 * std::sin(kPi * i / 8.0)}, {}});
  }
  const SplinePath spline(path);
  EXPECT_NEAR(spline.length_m(), 4.0 * kPi, 2e-3);
  for (double way_m = 0.0; way_m < spline.length_m(); way_m += 0.1) {
    EXPECT_NEAR(spline.at(way_m).p_world_m.norm(), 2.0, 1e-3);
    EXPECT_NEAR(spline.at(way_m).curvature_1_m, 0.5, 0.02);
  }
}

TEST(SplinePath, GoesStraightOnBeyondItsEnds) {
  const SplinePath spline(winding(false));
  const PathPoint end = spline.at(spline.length_m()), beyond = spline.at(spline.length_m() + 0.7);
  EXPECT_LT((end.pose() * Eigen::Vector2d(0.7, 0.0) - beyond.p_world_m).norm(), 1e-9);
  const PathPoint begin = spline.at(0.0), before = spline.at(-0.4);
  EXPECT_LT((begin.pose() * Eigen::Vector2d(-0.4, 0.0) - before.p_world_m).norm(), 1e-9);
}

TEST(SplinePath, NearestPointIsThatOfBruteForce) {
  Random random(3);
  for (const bool closed : {false, true}) {
    const SplinePath spline(winding(closed));
    for (int i = 0; i < 100; ++i) {
      const double way_m = random.uniform(0.0, spline.length_m());
      const Eigen::Vector2d p = spline.at(way_m).pose() * Eigen::Vector2d(random.uniform(-0.2, 0.2), 0.3);
      double least_m = 1e9;
      for (double s = 0.0; s <= spline.length_m(); s += 0.001) {
        least_m = std::min(least_m, (spline.at(s).p_world_m - p).norm());
      }
      const double global_m = spline.nearest_m(p), local_m = spline.nearest_m(p, way_m - 0.3);
      EXPECT_NEAR((spline.at(global_m).p_world_m - p).norm(), least_m, 1e-5);
      EXPECT_NEAR((spline.at(local_m).p_world_m - p).norm(), least_m, 1e-5);
      // It is the foot of the perpendicular, but at an end.
      if (local_m > 0.01 && local_m < spline.length_m() - 0.01) {
        EXPECT_NEAR((inverse(spline.at(local_m).pose()) * p).x(), 0.0, 1e-6);
      }
    }
  }
}

TEST(SplinePath, LocalSearchStaysOnItsBranch) {
  // Two ways 0.2 m apart, of one path.
  Path path{false, {}};
  for (const auto& [x, y] :
       {std::pair{0.0, 0.0}, {2.0, 0.0}, {4.0, 0.0}, {4.6, 0.1}, {4.0, 0.2}, {2.0, 0.2}, {0.0, 0.2}}) {
    path.way_points.push_back({{x, y}, {}});
  }
  const SplinePath spline(path);
  const Eigen::Vector2d nearer_to_the_second(1.0, 0.15);
  EXPECT_NEAR(spline.nearest_m(nearer_to_the_second, 0.8), 1.0, 0.05);
  EXPECT_GT(spline.nearest_m(nearer_to_the_second), 5.0);
}

TEST(SplinePath, MovesWithItsWayPoints) {
  const Pose2 T{{3.0, -7.0}, 2.1};
  for (const bool closed : {false, true}) {
    const Path path = winding(closed);
    const SplinePath a(path), b(moved(path, T));
    ASSERT_NEAR(a.length_m(), b.length_m(), 1e-9);
    for (double way_m = 0.0; way_m < a.length_m(); way_m += 0.37) {
      EXPECT_LT((T * a.at(way_m).p_world_m - b.at(way_m).p_world_m).norm(), 1e-9);
      EXPECT_NEAR(wrap_to_pi(a.at(way_m).yaw_rad + T.yaw_rad - b.at(way_m).yaw_rad), 0.0, 1e-9);
      EXPECT_NEAR(a.at(way_m).curvature_1_m, b.at(way_m).curvature_1_m, 1e-7);
    }
  }
}

TEST(SplinePath, RefusesToTurnBackOnTheSpot) {
  Path path{false, {{{0.0, 0.0}, {}}, {{1.0, 0.0}, {}}, {{0.0, 0.0}, {}}}};
  EXPECT_TRUE(names(refusal_of([&] { SplinePath(path, "my.yaml"); }), {"my.yaml"}));
}

}  // namespace
}  // namespace situation_awareness::spline_path_test

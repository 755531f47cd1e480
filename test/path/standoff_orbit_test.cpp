// SPDX-License-Identifier: BSD-3-Clause
#include "situation_awareness/path/standoff_orbit.hpp"

#include <gtest/gtest.h>

#include <cmath>

#include "path/dubins_paths.hpp"
#include "path/obstacle_scene.hpp"
#include "situation_awareness/geometry/vectors.hpp"
#include "situation_awareness/path/avoidance.hpp"

namespace situation_awareness::standoff_orbit_test {
namespace {

constexpr double kStandoff_m = 8.0, kRadius_m = 7.5;

/// Pose by pose: closed, without a break in place or heading.
double greatest_break(const SegmentPath& orbit) {
  double greatest = 0.0;
  Pose2 at;
  for (std::size_t i = 0; i <= orbit.segments.size(); ++i) {
    SegmentPath one;
    append(one, orbit.segments[i % orbit.segments.size()]);
    if (i > 0) greatest = std::max(greatest, distance(at, place_at(one, 0.0).pose));
    at = place_at(one, one.length_m).pose;
  }
  return greatest;
}

/// Turns around a point, counter-clockwise.
double sampled_turns(const SegmentPath& orbit, const Eigen::Vector2d& p_m) {
  double sum_rad = 0.0;
  const int count = 2000;
  for (int i = 0; i < count; ++i) {
    const Eigen::Vector2d a = place_at(orbit, orbit.length_m * i / count).pose.translation_m - p_m;
    const Eigen::Vector2d b = place_at(orbit, orbit.length_m * (i + 1) / count).pose.translation_m - p_m;
    sum_rad += std::atan2(cross(a, b), a.dot(b));
  }
  return sum_rad / (2.0 * kPi);
}

void expect_orbit(const Obstacles& scene, double side, const SegmentPath& orbit, const Eigen::Vector2d& middle_m,
                  double rounding_m = 1e-5) {
  EXPECT_LT(greatest_break(orbit), rounding_m);
  EXPECT_NEAR(clearance_m(orbit, scene), kStandoff_m, rounding_m);
  EXPECT_LE(greatest_curvature_1_m(orbit), (1.0 + 1e-6) / kRadius_m);
  EXPECT_NEAR(sampled_turns(orbit, middle_m), side, 1e-6);
  // Beside each place, away from the obstacle, there is a free circle.
  for (double way_m = 0.0; way_m < orbit.length_m; way_m += 1.0) {
    const Pose2 pose = place_at(orbit, way_m).pose;
    const Eigen::Vector2d center_m = pose * Eigen::Vector2d(0.0, -side * kRadius_m);
    EXPECT_GT(distance_m(scene, center_m), kStandoff_m + kRadius_m - rounding_m) << way_m;
  }
}

TEST(StandoffOrbit, AroundACircleAndABoxItIsKnown) {
  Obstacles scene;
  scene.add(Ellipse{{3.0, -2.0}, 0.0, 5.0, 5.0}, 0.0, 1);
  StandoffOrbit orbits;
  SegmentPath orbit;
  for (const double side : {1.0, -1.0}) {
    ASSERT_TRUE(orbits.trace(scene, 0, side, kStandoff_m, kRadius_m, {40.0, 0.0}, orbit));
    EXPECT_NEAR(orbit.length_m, 2.0 * kPi * (5.0 + kStandoff_m), 1e-9);
    expect_orbit(scene, side, orbit, {3.0, -2.0});
  }
  scene.clear();
  scene.add(tower(TowerShape::kBox), true, 0.0, ObstacleKind::kChain, 1);
  for (const double side : {1.0, -1.0}) {
    ASSERT_TRUE(orbits.trace(scene, 0, side, kStandoff_m, kRadius_m, {0.0, 30.0}, orbit));
    EXPECT_NEAR(orbit.length_m, 2.0 * (12.0 + 7.0) + 2.0 * kPi * kStandoff_m, 1e-9);
    expect_orbit(scene, side, orbit, {0.0, 0.0});
  }
}

// An open line from both sides; and a bow into which the circle does not fit.
TEST(StandoffOrbit, LeadsAroundOpenEnds) {
  Obstacles scene;
  scene.add({{-10.0, 1.0}, {20.0, 1.0}}, false, 0.0, ObstacleKind::kChain, 1);
  StandoffOrbit orbits;
  SegmentPath orbit;
  ASSERT_TRUE(orbits.trace(scene, 0, 1.0, kStandoff_m, kRadius_m, {0.0, 30.0}, orbit));
  EXPECT_NEAR(orbit.length_m, 2.0 * 30.0 + 2.0 * kPi * kStandoff_m, 1e-9);
  expect_orbit(scene, 1.0, orbit, {0.0, 1.0});
  scene.clear();
  Splinegon bow;
  bow.id = 1;
  bow.vertices = {{{10.0, 0.0}, std::tan(0.25 * 0.5 * kPi), 0.0, false},
                  {{0.0, 10.0}, std::tan(0.25 * 0.5 * kPi), 0.0, false},
                  {{-10.0, 0.0}, 0.0, 0.0, false}};
  scene.add(feature_of(bow));
  ASSERT_TRUE(orbits.trace(scene, 0, 1.0, kStandoff_m, kRadius_m, {0.0, 40.0}, orbit));
  expect_orbit(scene, 1.0, orbit, {0.0, 9.0});
}

TEST(StandoffOrbit, AroundOneOrMoreObstaclesOfAnyShape) {
  Random random(1);
  StandoffOrbit orbits;
  SegmentPath orbit, moved_orbit;
  int merged = 0;
  for (int i = 0; i < 150; ++i) {
    Obstacles scene, moved_scene;
    const int count = 1 + i % 4;
    const Pose2 move{{random.uniform(-100.0, 100.0), 50.0}, random.uniform(-kPi, kPi)};
    for (int k = 0; k < count; ++k) {
      const Pose2 T{{k % 2 * random.uniform(20.0, 45.0), k / 2 * random.uniform(20.0, 45.0)},
                    random.uniform(-kPi, kPi)};
      const auto outline = placed(T, tower(static_cast<TowerShape>((i / 4 + k) % 5)));
      const bool closed = random.uniform() < 0.6;
      scene.add(feature_of(splinegon_of(outline, static_cast<std::uint64_t>(k + 1), 0.05, closed)));
      moved_scene.add(feature_of(splinegon_of(placed(move, outline), static_cast<std::uint64_t>(k + 1), 0.05, closed)));
    }
    const double side = i % 2 == 0 ? 1.0 : -1.0;
    const std::size_t target = static_cast<std::size_t>(i) % scene.obstacles().size();
    const ObstaclePiece& piece = scene.pieces()[scene.obstacles()[target].first];
    const Eigen::Vector2d hint(random.uniform(-40.0, 60.0), random.uniform(-40.0, 60.0));
    ASSERT_TRUE(orbits.trace(scene, target, side, kStandoff_m, kRadius_m, hint, orbit)) << i;
    expect_orbit(scene, side, orbit, piece.middle_m);
    ASSERT_TRUE(orbits.trace(moved_scene, target, side, kStandoff_m, kRadius_m, move * hint, moved_orbit)) << i;
    EXPECT_NEAR(moved_orbit.length_m, orbit.length_m, 1e-5) << i;
    for (std::size_t k = 0; k < scene.obstacles().size(); ++k) {
      const Eigen::Vector2d other_m = scene.pieces()[scene.obstacles()[k].first].middle_m;
      merged += k != target && std::abs(sampled_turns(orbit, other_m)) > 0.5 ? 1 : 0;
    }
  }
  EXPECT_GT(merged, 20);
}

// Outlines that cross each other: an obstacle that was mapped twice, in pieces, as arcs and as lines. The circle comes
// over their joints so closely that it touches now the end of one piece, now the piece beside it.
TEST(StandoffOrbit, AroundOutlinesThatCrossEachOther) {
  Random random(2);
  StandoffOrbit orbits;
  SegmentPath orbit;
  for (int i = 0; i < 60; ++i) {
    Obstacles scene;
    const auto shape = static_cast<TowerShape>(i % 5);
    const int copies = 2 + i % 3;
    for (int k = 0; k < copies; ++k) {
      const Pose2 T{{random.uniform(-1.5, 1.5), random.uniform(-1.5, 1.5)}, random.uniform(-0.1, 0.1)};
      const auto outline = placed(T, tower(shape));
      const auto id = static_cast<std::uint64_t>(k + 1);
      if (k % 2 == 0) {
        scene.add(feature_of(splinegon_of(outline, id, 0.05, k == 0)));
      } else {
        const auto from = static_cast<std::ptrdiff_t>(random.uniform(0.0, 0.5) * static_cast<double>(outline.size()));
        scene.add({outline.begin() + from, outline.end()}, false, 0.05, ObstacleKind::kChain, id);
      }
    }
    for (const double side : {1.0, -1.0}) {
      for (std::size_t target = 0; target < scene.obstacles().size(); ++target) {
        const Eigen::Vector2d hint(random.uniform(-40.0, 40.0), random.uniform(-40.0, 40.0));
        if (orbits.trace(scene, target, side, kStandoff_m, kRadius_m, hint, orbit)) {
          expect_orbit(scene, side, orbit, {0.0, 0.0}, 1e-4);
          continue;
        }
        // Only if the others are before it all around.
        const std::size_t other = target == 0 ? 1 : 0;
        ASSERT_TRUE(orbits.trace(scene, other, side, kStandoff_m, kRadius_m, hint, orbit)) << i;
        Obstacles alone;
        const Obstacle& hidden = scene.obstacles()[target];
        for (std::size_t k = hidden.first; k < hidden.first + hidden.pieces; ++k) {
          const Curve& curve = scene.pieces()[k].curve;
          alone.add({curve.from_m, point_at(curve, 0.5 * curve.length_m), point_at(curve, curve.length_m)}, false, 0.0,
                    hidden.kind, 1);
        }
        EXPECT_GT(clearance_m(orbit, alone), kStandoff_m + 1e-4) << i << " " << target;
      }
    }
  }
}

// What lies within another obstacle, or among several, is gone around with these.
TEST(StandoffOrbit, GoesAroundWhatIsHiddenToo) {
  Obstacles scene;
  scene.add(Ellipse{{0.0, 0.0}, 0.0, 20.0, 20.0}, 0.0, 1);
  scene.add({{-2.0, 1.0}, {3.0, 1.0}}, false, 0.0, ObstacleKind::kChain, 2);
  scene.add(Ellipse{{90.0, 0.0}, 0.0, 5.0, 5.0}, 0.0, 3);
  StandoffOrbit orbits;
  SegmentPath alone, orbit;
  for (const double side : {1.0, -1.0}) {
    ASSERT_TRUE(orbits.trace(scene, 0, side, kStandoff_m, kRadius_m, {0.0, 50.0}, alone));
    for (const Eigen::Vector2d& hint : {Eigen::Vector2d(0.0, 50.0), Eigen::Vector2d(120.0, 0.0)}) {
      ASSERT_TRUE(orbits.trace(scene, 1, side, kStandoff_m, kRadius_m, hint, orbit));
      expect_orbit(scene, side, orbit, {0.0, 1.0});
      EXPECT_NEAR(orbit.length_m, alone.length_m, 1e-6);
    }
    EXPECT_EQ(turns_around(orbit, {0.0, 1.0}), static_cast<int>(side));
    EXPECT_EQ(turns_around(orbit, {90.0, 0.0}), 0);
  }
}

// Of what the vehicle fits between it goes around each alone, else around both.
TEST(StandoffOrbit, PassesOnlyWhereThereIsRoomToTurn) {
  StandoffOrbit orbits;
  SegmentPath orbit;
  for (const double gap_m : {3.0, 20.0, 30.9, 31.1}) {
    Obstacles scene;
    scene.add(Ellipse{{0.0, 0.0}, 0.0, 5.0, 5.0}, 0.0, 1);
    scene.add(Ellipse{{10.0 + gap_m, 0.0}, 0.0, 5.0, 5.0}, 0.0, 2);
    ASSERT_TRUE(orbits.trace(scene, 0, 1.0, kStandoff_m, kRadius_m, {0.0, 40.0}, orbit));
    const bool together = gap_m < 2.0 * (kStandoff_m + kRadius_m);
    EXPECT_NEAR(sampled_turns(orbit, {0.0, 0.0}), 1.0, 1e-6);
    EXPECT_NEAR(sampled_turns(orbit, {10.0 + gap_m, 0.0}), together ? 1.0 : 0.0, 1e-6) << gap_m;
  }
}

}  // namespace
}  // namespace situation_awareness::standoff_orbit_test

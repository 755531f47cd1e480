// SPDX-License-Identifier: BSD-3-Clause
#include "situation_awareness/path/avoidance.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <limits>

#include "path/dubins_paths.hpp"
#include "situation_awareness/common/random.hpp"
#include "situation_awareness/geometry/angles.hpp"
#include "support/refusal.hpp"

namespace situation_awareness::avoidance_test {
namespace {

/// Everything of a random scene: boundaries of arcs, chains, circles and ellipses.
Obstacles random_scene(Random& random, int count, double size_m) {
  Obstacles scene;
  for (int i = 0; i < count; ++i) {
    const Eigen::Vector2d center(random.uniform(-size_m, size_m), random.uniform(-size_m, size_m));
    const double radius_m = random.uniform(0.3, 5.0), sigma_m = random.uniform(0.0, 0.3);
    const auto id = static_cast<std::uint64_t>(i + 1);
    if (i % 3 == 0) {
      scene.add(Ellipse{center, random.uniform(-1.0, 1.0), radius_m, i % 2 == 0 ? radius_m : 0.6 * radius_m}, sigma_m,
                id);
      continue;
    }
    ArcShape boundary;
    PolylineShape chain;
    boundary.closed = chain.closed = random.uniform() < 0.5;
    for (int k = 0; k < 8; ++k) {
      const double t = 2.0 * kPi * k / 8.0;
      const Eigen::Vector2d p =
          center + radius_m * random.uniform(0.7, 1.3) * Eigen::Vector2d(std::cos(t), std::sin(t));
      boundary.vertices.push_back({p, random.uniform(-0.4, 0.4), sigma_m, false});
      chain.vertices.push_back({p, sigma_m});
    }
    Feature feature;
    feature.id = id;
    if (i % 3 == 1) feature.shape = boundary;
    if (i % 3 == 2) feature.shape = chain;
    scene.add(feature);
  }
  return scene;
}

double nearest_margin_m(const SegmentPath& path, double way_m, const Obstacles& scene, double pose_sigma_m,
                        const AvoidanceParams& params) {
  double least_m = std::numeric_limits<double>::infinity();
  const Eigen::Vector2d p = place_at(path, way_m).pose.translation_m;
  for (const ObstaclePiece& piece : scene.pieces()) {
    least_m = std::min(least_m, distance_m(piece.curve, p) - margin_m(piece, pose_sigma_m, params));
  }
  return least_m;
}

TEST(Avoidance, TheWayThatIsFreeAgreesWithASearch) {
  const AvoidanceParams params;
  Random random(1);
  int blocked = 0;
  for (int i = 0; i < 400; ++i) {
    const Obstacles scene = random_scene(random, 5, 60.0);
    SegmentPath path;
    append(path, shortest_dubins_path(random_end(random, 60.0, 7.5), random_end(random, 60.0, 7.5)));
    const double pose_sigma_m = random.uniform(0.0, 0.5);
    if (nearest_margin_m(path, 0.0, scene, pose_sigma_m, params) < 0.0) continue;
    const PathCheck result = check(path, 0.0, path.length_m, scene, pose_sigma_m, params);
    blocked += result.free ? 0 : 1;
    for (double way_m = 0.0; way_m < result.free_m; way_m += 0.05) {
      ASSERT_GT(nearest_margin_m(path, way_m, scene, pose_sigma_m, params), -1e-6) << i << " at " << way_m;
    }
    if (result.free) continue;
    EXPECT_NEAR(nearest_margin_m(path, result.free_m, scene, pose_sigma_m, params), 0.0, 1e-6) << i;
    EXPECT_LT(nearest_margin_m(path, result.free_m + 1e-3, scene, pose_sigma_m, params), 0.0) << i;
    // From a later begin it is the same place.
    const PathCheck later = check(path, 0.5 * result.free_m, path.length_m, scene, pose_sigma_m, params);
    EXPECT_NEAR(later.free_m, result.free_m, 1e-6);
    EXPECT_TRUE(check(path, 0.0, result.free_m - 1e-3, scene, pose_sigma_m, params).free);
  }
  EXPECT_GT(blocked, 100);
}

TEST(Avoidance, DistanceFromAWallAcrossTheWay) {
  AvoidanceParams params;
  params.clearance_m = 3.0;
  params.sigmas = 2.0;
  Obstacles scene;
  scene.add({{50.0, -20.0}, {50.0, 20.0}}, false, 0.3, ObstacleKind::kChain, 7);
  SegmentPath path;
  append(path, shortest_dubins_path({{0.0, 0.0}, 0.0, 7.5}, {{100.0, 0.0}, 0.0, 7.5}));
  const PathCheck result = check(path, 0.0, path.length_m, scene, 0.4, params);
  EXPECT_FALSE(result.free);
  EXPECT_NEAR(result.free_m, 50.0 - 3.0 - 2.0 * 0.5, 1e-9);  // sigma: the root of 0.3^2 + 0.4^2
  EXPECT_NEAR(clearance_m(path, scene), 0.0, 1e-9);
  // At the stopping way before the wall's margin a turn by a right angle still is free.
  const double speed_m_s = 5.0;
  const double x_m = result.free_m - speed_m_s * params.reaction_s - params.turn_radius_m;
  SegmentPath turn;
  append(turn, Straight{{x_m, 0.0}, {x_m + speed_m_s * params.reaction_s, 0.0}, 0.0});
  append(turn, holding_circle({{x_m + speed_m_s * params.reaction_s, 0.0}, 0.0}, 1.0, params));
  EXPECT_TRUE(check(turn, 0.0, turn.length_m, scene, 0.4, params).free);
  EXPECT_LE(speed_m_s * params.reaction_s + 0.5 * kPi * params.turn_radius_m, stopping_way_m(speed_m_s, params));
}

// A vehicle that is too near may go away and along, not nearer.
TEST(Avoidance, LeadsAwayFromWhatIsTooNear) {
  const AvoidanceParams params;
  Obstacles scene;
  scene.add({{-50.0, 0.0}, {50.0, 0.0}}, false, 0.0, ObstacleKind::kChain, 1);
  const auto straight = [](double yaw_rad) {
    SegmentPath path;
    append(path, Straight{{0.0, 2.0}, {20.0 * std::cos(yaw_rad), 2.0 + 20.0 * std::sin(yaw_rad)}, yaw_rad});
    return path;
  };
  EXPECT_TRUE(check(straight(0.1), 0.0, 20.0, scene, 0.0, params).free);
  EXPECT_TRUE(check(straight(0.0), 0.0, 20.0, scene, 0.0, params).free);
  const PathCheck nearer = check(straight(-0.1), 0.0, 20.0, scene, 0.0, params);
  EXPECT_FALSE(nearer.free);
  EXPECT_LT(nearer.free_m, 1.0);
}

TEST(Avoidance, PlansAroundByAnIntermediatePose) {
  const AvoidanceParams params;
  Random random(2);
  int around = 0, none = 0;
  for (int i = 0; i < 200; ++i) {
    const Obstacles scene = random_scene(random, 1 + i % 4, 40.0);
    const Pose2 from{{-70.0, random.uniform(-20.0, 20.0)}, random.uniform(-1.0, 1.0)};
    const DubinsEnd to{{70.0, random.uniform(-20.0, 20.0)}, random.uniform(-1.0, 1.0), params.turn_radius_m};
    SegmentPath path;
    const DubinsPath direct = shortest_dubins_path({from.translation_m, from.yaw_rad, params.turn_radius_m}, to);
    if (!plan_around(from, to, scene, 0.1, params, path)) {
      EXPECT_TRUE(path.segments.empty());
      ++none;
      continue;
    }
    EXPECT_TRUE(check(path, 0.0, path.length_m, scene, 0.1, params).free);
    EXPECT_GE(clearance_m(path, scene), params.clearance_m + params.sigmas * 0.1 - 1e-6);
    EXPECT_LE(greatest_curvature_1_m(path), (1.0 + 1e-12) / params.turn_radius_m);
    EXPECT_GE(path.length_m, direct.length_m - 1e-9);
    EXPECT_LT(distance(place_at(path, 0.0).pose, from), 1e-9);
    EXPECT_LT(distance(place_at(path, path.length_m).pose, pose_of(to)), 1e-6);
    for (double way_m = 0.0; way_m + 1e-3 < path.length_m; way_m += 0.5) {
      const Pose2 a = place_at(path, way_m).pose, b = place_at(path, way_m + 1e-3).pose;
      EXPECT_LT((a.translation_m - b.translation_m).norm(), 1.001e-3);
    }
    around += path.length_m > direct.length_m + 1e-9 ? 1 : 0;
  }
  EXPECT_GT(around, 40);
  EXPECT_LT(none, 40);
}

TEST(Avoidance, AnEllipseIsWithinItsPolygon) {
  Random random(3);
  for (int i = 0; i < 100; ++i) {
    const Ellipse ellipse{{1.0, 2.0}, random.uniform(-1.5, 1.5), random.uniform(0.5, 5.0), random.uniform(0.5, 5.0)};
    Obstacles scene;
    scene.add(ellipse, 0.0, 1);
    ASSERT_EQ(scene.obstacles().size(), 1U);
    EXPECT_TRUE(scene.obstacles()[0].closed);
    const double larger_m = std::max(ellipse.rx_m, ellipse.ry_m);
    for (const Eigen::Vector2d& p : points_on(ellipse, 50)) {
      EXPECT_LT(distance_m(scene, p), 0.006 * larger_m);
      const Eigen::Vector2d out = p + 2.0 * (p - ellipse.center_m).normalized();
      EXPECT_LT(distance_m(scene, out), offset_m(ellipse, out) + 1e-6);
    }
  }
}

TEST(Avoidance, OfAnObjectItIsTheEllipseOrTheBox) {
  BodyState body;
  body.covariance(object_error::kPosition, object_error::kPosition) = 0.09;
  body.covariance(object_error::kRadii, object_error::kRadii) = 0.16;
  Feature feature;
  feature.shape = EllipseShape{{{10.0, 0.0}, 0.0, 2.0, 2.0}, body};
  Obstacles scene;
  scene.add(feature);
  EXPECT_NEAR(distance_m(scene, {5.0, 0.0}), 3.0, 1e-9);
  EXPECT_NEAR(scene.obstacles()[0].sigma_m, 0.5, 1e-9);
  feature.shape = BoxShape{{{10.0, 0.0}, 0.0, 3.0, 1.0}, body};
  scene.clear();
  scene.add(feature);
  EXPECT_NEAR(distance_m(scene, {5.0, 0.0}), 2.0, 1e-9);
  EXPECT_EQ(scene.pieces().size(), 4U);
}

// All pieces are in the runs, in order, and within their circles.
TEST(Avoidance, RunsCoverAllPieces) {
  Random random(4);
  for (int i = 0; i < 50; ++i) {
    const Obstacles scene = random_scene(random, 6, 40.0);
    std::size_t next = 0;
    for (const PieceRun& run : scene.runs()) {
      ASSERT_EQ(run.first, next);
      next = run.end;
      for (std::size_t k = run.first; k < run.end; ++k) {
        const ObstaclePiece& piece = scene.pieces()[k];
        EXPECT_EQ(piece.obstacle, scene.pieces()[run.first].obstacle);
        EXPECT_LE(piece.sigma_m, run.sigma_m);
        for (const double part : {0.0, 0.3, 0.7, 1.0}) {
          const Eigen::Vector2d p_m = point_at(piece.curve, part * piece.curve.length_m);
          EXPECT_LE((p_m - run.middle_m).norm(), run.radius_m + 1e-9);
        }
      }
    }
    EXPECT_EQ(next, scene.pieces().size());
  }
}

TEST(Avoidance, NamesWhatIsOutOfBounds) {
  AvoidanceParams params;
  params.turn_radius_m = 0.0;
  EXPECT_TRUE(names(refusal_of([&] { params.validate(); }), {"avoidance.turn_radius_m", "0"}));
}

}  // namespace
}  // namespace situation_awareness::avoidance_test

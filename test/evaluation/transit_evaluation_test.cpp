// SPDX-License-Identifier: BSD-3-Clause
#include "situation_awareness/evaluation/transit_evaluation.hpp"

#include <cmath>
#include <limits>
#include <random>
#include <stdexcept>
#include <string>
#include <vector>

#include <gtest/gtest.h>
#include <Eigen/Cholesky>

#include "situation_awareness/geometry/angles.hpp"

namespace situation_awareness::transit_evaluation_test {
namespace {

using Outline = std::vector<Eigen::Vector2d>;

Outline box(double x, double y, double half_x, double half_y) {
  return {{x - half_x, y - half_y}, {x + half_x, y - half_y}, {x + half_x, y + half_y}, {x - half_x, y + half_y}};
}

/// A room of 6 m by 6 m, a box in it, and a post.
std::vector<TransitThing> room(bool with_box) {
  return {{"wall", true, false, false, {box(0.0, 0.0, 3.0, 3.0)}},
          {"box", with_box, false, false, {box(1.5, 0.0, 0.2, 0.3)}},
          {"post", true, false, false, {box(-1.0, 1.0, 0.05, 0.05)}},
          {"person", true, true, false, {box(0.0, 1.5, 0.2, 0.2)}}};
}

Scan scan_of(const std::vector<TransitThing>& things, const Pose2& T_world_lidar) {
  constexpr int kBeams = 720;
  Scan scan;
  scan.angle_min_rad = -kPi;
  scan.angle_increment_rad = 2.0 * kPi / kBeams;
  for (int i = 0; i < kBeams; ++i) {
    const double angle_rad = T_world_lidar.yaw_rad + scan.angle_min_rad + i * scan.angle_increment_rad;
    const Eigen::Vector2d d(std::cos(angle_rad), std::sin(angle_rad));
    double range_m = std::numeric_limits<double>::infinity();
    for (const TransitThing& thing : things) {
      if (!thing.is_there || thing.can_move) continue;
      for (const Outline& outline : thing.outlines_world_m) {
        for (std::size_t k = 0; k < outline.size(); ++k) {
          const Eigen::Vector2d a = outline[k] - T_world_lidar.translation_m;
          const Eigen::Vector2d e = outline[(k + 1) % outline.size()] - outline[k];
          const double det = d.x() * e.y() - d.y() * e.x();
          const double t = (a.x() * e.y() - a.y() * e.x()) / det, u = (a.x() * d.y() - a.y() * d.x()) / det;
          if (t > 0.0 && u >= 0.0 && u <= 1.0) range_m = std::min(range_m, t);
        }
      }
    }
    scan.beams.push_back({static_cast<float>(range_m), BeamState::kHit, kNoIntensity});
  }
  return scan;
}

Polygons map_of(const std::vector<TransitThing>& things) {
  Polygons map;
  for (const TransitThing& thing : things) {
    if (thing.can_move || !thing.is_there) continue;
    for (const Outline& outline : thing.outlines_world_m) {
      Chain chain;
      chain.id = map.chains.size() + 1;
      chain.closed = true;
      for (const Eigen::Vector2d& p : outline) chain.vertices.push_back({p, 0.01});
      map.chains.push_back(chain);
    }
  }
  return map;
}

void drive(TransitEvaluation& evaluation, const std::vector<TransitThing>& things, bool around = true) {
  for (int i = 0; i < 40; ++i) {
    const double angle_rad = around ? 2.0 * kPi * i / 40 : 0.01 * i;
    const Pose2 T{{2.2 * std::cos(angle_rad) - (around ? 0.0 : 4.6), 1.9 * std::sin(angle_rad)}, angle_rad};
    evaluation.add_scan(scan_of(things, T), T, T);
  }
}

TEST(TransitEvaluation, TheTruthHasNoErrors) {
  TransitEvaluation evaluation;
  evaluation.begin(1, room(true));
  drive(evaluation, room(true));
  const TransitScore score = evaluation.end(10.0, map_of(room(true)));
  EXPECT_LT(score.max_distance_m, 1e-9);
  EXPECT_EQ(score.false_m, 0.0);
  EXPECT_EQ(score.coverage, 1.0);
  EXPECT_EQ(score.in_sight, (std::vector<std::string>{"wall", "box", "post"}));
  EXPECT_TRUE(score.missed.empty() && score.appeared.empty() && score.gone.empty());
  EXPECT_NE(format_table({score}).find("3 of 3"), std::string::npos);
}

TEST(TransitEvaluation, MeasuresTheDistanceOfChains) {
  const std::vector<TransitThing> things = {{"wall", true, false, false, {box(0.0, 0.0, 3.0, 3.0)}}};
  TransitEvaluation evaluation;
  evaluation.begin(1, things);
  drive(evaluation, things);
  // Two of four equal sides are 2 cm off, the others 4 cm.
  Polygons map = map_of({{"wall", true, false, false, {box(0.0, 0.0, 3.02, 3.04)}}});
  for (Chain& chain : map.chains) chain.closed = true;
  const TransitScore score = evaluation.end(10.0, map);
  EXPECT_NEAR(score.mean_distance_m, 0.03, 2e-4);
  EXPECT_NEAR(score.sigma_distance_m, 0.01, 2e-4);
  EXPECT_NEAR(score.max_distance_m, std::hypot(0.02, 0.04), 5e-3);  // near the corners
  EXPECT_EQ(score.false_m, 0.0);
}

TEST(TransitEvaluation, SeesWhatAppearsAndGoes) {
  TransitEvaluation evaluation;
  evaluation.begin(1, room(false));
  drive(evaluation, room(false));
  EXPECT_EQ(evaluation.end(10.0, map_of(room(false))).in_sight.size(), 2U);
  evaluation.begin(2, room(true));
  drive(evaluation, room(true));
  TransitScore score = evaluation.end(10.0, map_of(room(false)));
  EXPECT_EQ(score.appeared, std::vector<std::string>{"box"});
  EXPECT_EQ(score.appeared_missed, std::vector<std::string>{"box"});
  EXPECT_EQ(score.missed, std::vector<std::string>{"box"});
  EXPECT_LT(score.coverage, 0.99);
  score = evaluation.end(10.0, map_of(room(true)));
  EXPECT_TRUE(score.missed.empty());
  EXPECT_LT(score.max_distance_m, 1e-9);

  evaluation.begin(3, room(false));
  drive(evaluation, room(false));
  score = evaluation.end(10.0, map_of(room(true)));
  EXPECT_EQ(score.gone, std::vector<std::string>{"box"});
  EXPECT_EQ(score.gone_left, std::vector<std::string>{"box"});
  EXPECT_GT(score.false_m, 1.9);
  score = evaluation.end(10.0, map_of(room(false)));
  EXPECT_TRUE(score.gone_left.empty());
  EXPECT_EQ(score.false_m, 0.0);
}

TEST(TransitEvaluation, WhatNoBeamTellsMayStayOnTheMap) {
  std::vector<TransitThing> things = room(true);
  things.push_back({"screen", false, false, false, {box(0.8, 0.0, 0.02, 1.5)}});
  TransitEvaluation evaluation;
  evaluation.begin(1, things);
  drive(evaluation, things);
  evaluation.end(10.0, map_of(things));
  things[1].is_there = false;  // behind the screen, seen from -x
  things[4].is_there = true;
  evaluation.begin(2, things);
  drive(evaluation, things, /*around=*/false);
  std::vector<TransitThing> on_map = things;
  on_map[1].is_there = true;
  const TransitScore score = evaluation.end(10.0, map_of(on_map));
  EXPECT_LT(score.max_distance_m, 0.011);  // by bins of 2 cm
  EXPECT_TRUE(score.gone.empty());
}

TEST(TransitEvaluation, PosesAreJudgedByTheirCovariance) {
  TransitEvaluation evaluation;
  evaluation.begin(1, room(true));
  std::mt19937 random(1);
  std::normal_distribution<double> normal;
  Eigen::Matrix3d covariance;
  covariance << 4e-6, 1e-6, 1e-7, 1e-6, 2e-6, 0.0, 1e-7, 0.0, 1e-6;
  const Eigen::Matrix3d root = covariance.llt().matrixL();
  constexpr int kPoses = 4000;
  for (int i = 0; i < kPoses; ++i) {
    const Pose2 truth{{0.01 * i, 1.0}, 0.02 * i};
    const Eigen::Vector3d error = root * Eigen::Vector3d(normal(random), normal(random), normal(random));
    evaluation.add_pose({truth.translation_m + error.head<2>(), truth.yaw_rad + error.z() - 2.0 * kPi}, covariance,
                        truth);
  }
  const TransitScore score = evaluation.end(10.0, {});
  EXPECT_EQ(score.poses, kPoses);
  EXPECT_NEAR(score.nees, 3.0, 4.0 * std::sqrt(6.0 / kPoses));
  EXPECT_NEAR(score.position_rms_m, std::sqrt(6e-6), 1e-4);
  EXPECT_NEAR(score.yaw_rms_rad, 1e-3, 5e-5);
  EXPECT_TRUE(std::isnan(score.mean_distance_m));
}

TEST(TransitEvaluation, CountsStops) {
  TransitEvaluation evaluation;
  evaluation.begin(1, room(true));
  double x_m = 0.0;
  for (int i = 0; i < 500; ++i) {
    const bool stands = i < 20 || (i > 100 && i < 160) || (i > 300 && i < 330) || i > 450;
    x_m += stands ? 0.0 : 0.02;
    evaluation.add_motion(40'000'000LL * i, {{x_m, 0.0}, 0.0});
  }
  EXPECT_EQ(evaluation.end(20.0, {}).stops, 2);
}

TEST(TransitEvaluation, RefusesOtherThings) {
  TransitEvaluation evaluation;
  evaluation.begin(1, room(true));
  std::vector<TransitThing> other = room(true);
  other.pop_back();
  EXPECT_THROW(evaluation.begin(2, other), std::invalid_argument);
}

}  // namespace
}  // namespace situation_awareness::transit_evaluation_test

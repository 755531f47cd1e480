// SPDX-License-Identifier: BSD-3-Clause
#include "situation_awareness/evaluation/grid_scenes.hpp"

#include <gtest/gtest.h>

#include <vector>

namespace situation_awareness::grid_scenes_test {
namespace {

GridCase cars_at(const std::vector<Eigen::Vector2d>& places_m) {
  GridCase given;
  given.scene.ground = [](double, double) { return 0.0; };
  for (const Eigen::Vector2d& p_m : places_m) given.scene.cars.push_back({Pose2{p_m, 0.0}});
  return given;
}

GridTargets targets_at(const std::vector<Eigen::Vector2d>& places_m) {
  GridTargets targets;
  for (const Eigen::Vector2d& p_m : places_m) {
    GridTarget target;
    target.p_world_m << p_m, 0.0;
    target.covariance_m2 = 0.25 * Eigen::Matrix2d::Identity();
    targets.targets.push_back(target);
  }
  return targets;
}

TEST(GridScores, AMissedCarIsNotInsideItsRegion) {
  const TargetScore none = score(cars_at({{0.0, 0.0}, {20.0, 0.0}}), GridTargets{});
  EXPECT_EQ(none.cars, 2);
  EXPECT_EQ(none.missed, 2);
  EXPECT_EQ(none.inside, 0);
  const TargetScore half = score(cars_at({{0.0, 0.0}, {20.0, 0.0}}), targets_at({{0.5, 0.0}}));
  EXPECT_EQ(half.missed, 1);
  EXPECT_EQ(half.inside, 1);
  EXPECT_DOUBLE_EQ(half.distance_sum_m, 0.5);
}

TEST(GridScores, ATargetServesOneCarOnly) {
  const TargetScore result = score(cars_at({{0.0, 0.0}, {4.0, 0.0}}), targets_at({{1.9, 0.0}}));
  EXPECT_EQ(result.missed, 1);
  EXPECT_EQ(result.wrong, 0);
  EXPECT_EQ(result.inside, 0);  // 1.9 m are 3.8 standard deviations
}

TEST(GridScores, ASecondTargetOfACarIsWrong) {
  const TargetScore result = score(cars_at({{0.0, 0.0}}), targets_at({{1.0, 0.0}, {-0.25, 0.0}}));
  EXPECT_EQ(result.missed, 0);
  EXPECT_EQ(result.wrong, 1);
  EXPECT_DOUBLE_EQ(result.distance_sum_m, 0.25);
}

TEST(GridScores, TargetsAreGivenToAsManyCarsAsCanBe) {
  // The nearest target of both cars is the first one, but the first car has another.
  const TargetScore result = score(cars_at({{0.0, 0.0}, {2.0, 0.0}}), targets_at({{0.9, 0.0}, {-2.5, 0.0}}));
  EXPECT_EQ(result.missed, 0);
  EXPECT_EQ(result.wrong, 0);
}

}  // namespace
}  // namespace situation_awareness::grid_scenes_test

// SPDX-License-Identifier: BSD-3-Clause
#include "situation_awareness/evaluation/boundary_evaluation.hpp"

#include <cmath>
#include <utility>

#include <gtest/gtest.h>

#include "situation_awareness/geometry/angles.hpp"

namespace situation_awareness::boundary_evaluation_test {
namespace {

Splinegon circle(const Eigen::Vector2d& center_m, double radius_m, double sigma_m, std::uint64_t id = 1) {
  Splinegon result;
  result.id = id;
  result.closed = true;
  const double bulge = std::tan(kPi / 8.0);  // of quarters
  for (const auto& [x, y] : {std::pair(1.0, 0.0), {0.0, 1.0}, {-1.0, 0.0}, {0.0, -1.0}}) {
    result.vertices.push_back({center_m + radius_m * Eigen::Vector2d(x, y), bulge, sigma_m, false});
  }
  return result;
}

TrueObstacle round_tower(const Eigen::Vector2d& center_m, double radius_m) {
  TrueObstacle result{"tower", {}};
  for (int i = 0; i < 720; ++i) {
    const double angle_rad = 2.0 * kPi * i / 720;
    result.outline_world_m.push_back(center_m + radius_m * Eigen::Vector2d(std::cos(angle_rad), std::sin(angle_rad)));
  }
  return result;
}

TEST(BoundaryEvaluation, ATrueBoundaryHasNoError) {
  const auto scores = score_boundaries({round_tower({3.0, 4.0}, 8.0)}, {0, {circle({3.0, 4.0}, 8.0, 0.2)}});
  ASSERT_EQ(scores.size(), 1U);
  EXPECT_EQ(scores[0].boundaries, 1U);
  EXPECT_TRUE(scores[0].closed);
  EXPECT_LT(scores[0].hausdorff_m, 2e-4);  // of the polygon
  EXPECT_NEAR(scores[0].area_part, 0.0, 1e-4);
  EXPECT_NEAR(scores[0].sigma_m, 0.2, 1e-12);
  EXPECT_EQ(scores[0].in_envelope_part, 1.0);
}

TEST(BoundaryEvaluation, ACircleOfAnotherRadiusIsOffByTheDifference) {
  const auto scores = score_boundaries({round_tower({0.0, 0.0}, 8.0)}, {0, {circle({0.0, 0.0}, 8.5, 0.1)}});
  EXPECT_NEAR(scores[0].hausdorff_m, 0.5, 1e-3);
  EXPECT_NEAR(scores[0].mean_m, 0.5, 1e-3);
  EXPECT_NEAR(scores[0].area_part, 8.5 * 8.5 / 64.0 - 1.0, 1e-4);
  EXPECT_EQ(scores[0].in_envelope_part, 0.0) << "0.26 m to either side";
}

TEST(BoundaryEvaluation, ACircleThatIsElsewhereIsOffByItsWayAndTwoThirdsPiOfItOnTheMean) {
  const auto scores = score_boundaries({round_tower({0.0, 0.0}, 8.0)}, {0, {circle({0.4, 0.0}, 8.0, 1.0)}});
  EXPECT_NEAR(scores[0].hausdorff_m, 0.4, 1e-3);
  EXPECT_NEAR(scores[0].mean_m, 0.4 * 2.0 / kPi, 0.01);  // the mean of |cos|
  EXPECT_EQ(scores[0].in_envelope_part, 1.0);
}

TEST(BoundaryEvaluation, BoundariesCountForTheNearestObstacle) {
  const std::vector<TrueObstacle> obstacles{round_tower({0.0, 0.0}, 5.0), round_tower({30.0, 0.0}, 5.0),
                                            round_tower({0.0, 30.0}, 5.0)};
  Splinegon piece = circle({30.0, 0.0}, 5.0, 0.1, 2);
  piece.closed = false;
  piece.vertices.pop_back();
  piece.vertices.back().bulge = 0.0;
  const auto scores =
      score_boundaries(obstacles, {0, {piece, circle({30.1, 0.0}, 5.0, 0.1, 3), circle({0.0, 0.0}, 5.0, 0.1, 4)}});
  EXPECT_EQ(scores[0].boundaries, 1U);
  EXPECT_EQ(scores[1].boundaries, 2U);
  EXPECT_TRUE(scores[1].closed) << "the longer one";
  EXPECT_EQ(scores[2].boundaries, 0U);
  EXPECT_TRUE(std::isinf(scores[2].hausdorff_m));
  const std::string table = format_table(scores);
  EXPECT_NE(table.find("tower"), std::string::npos);
  EXPECT_NE(table.find("inf"), std::string::npos);
}

TEST(BoundaryEvaluation, AnOpenBoundaryHasNoArea) {
  Splinegon half = circle({0.0, 0.0}, 5.0, 0.1);
  half.closed = false;
  half.vertices.pop_back();
  half.vertices.back().bulge = 0.0;
  const auto scores = score_boundaries({round_tower({0.0, 0.0}, 5.0)}, {0, {half}});
  EXPECT_FALSE(scores[0].closed);
  EXPECT_TRUE(std::isnan(scores[0].area_part));
  EXPECT_LT(scores[0].mean_m, 1e-3) << "what is there is right";
  EXPECT_NEAR(scores[0].hausdorff_m, std::sqrt(2.0) * 5.0, 0.01) << "from the far side to the ends";
}

}  // namespace
}  // namespace situation_awareness::boundary_evaluation_test

// SPDX-License-Identifier: BSD-3-Clause
#include "situation_awareness/map/grid/grid_map.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <cstddef>
#include <cstdint>
#include <limits>
#include <memory>
#include <stdexcept>
#include <string>
#include <vector>

#include "situation_awareness/evaluation/grid_scenes.hpp"
#include "situation_awareness/geometry/angles.hpp"
#include "support/grid_ground.hpp"

namespace situation_awareness::grid_map_test {
namespace {

GridMap map_of(const GridCase& given, int size, std::shared_ptr<const Elevation> elevation) {
  GridMap map(GridMapParams{}, std::move(elevation));
  for (std::size_t i = 0; i < given.T_world_camera.size(); ++i) {
    map.update(labels_of(given, square_camera(size), i, 1), given_pose(given, i, 1));
  }
  return map;
}

SoftLabels uniform_labels(float probability) {
  SoftLabels labels;
  labels.camera = square_camera(56);
  labels.probability.assign(56 * 56, probability);
  return labels;
}

const Eigen::Isometry3d kPose = camera_pose({0.0, 0.0, 20.0}, 0.0, radians(-20.0));

float probability_at(const SemanticGrid& grid, double x, double y) {
  return grid.probability[grid.index(static_cast<int>(std::floor(x / grid.cell_m)) - grid.first_column,
                                     static_cast<int>(std::floor(y / grid.cell_m)) - grid.first_row)];
}

TEST(GridMap, FindsACarByOneImageWithoutItsShadow) {
  constexpr std::uint32_t kSeeds = 4;
  double overlap = 0.0, shadow = 0.0;
  for (std::uint32_t seed = 1; seed <= kSeeds; ++seed) {
    const GridCase given = make_grid_case("single", seed);
    const GridScore found = score(given, map_of(given, 112, flat_ground()).grid());
    overlap += found.intersection_over_union / kSeeds;
    shadow += found.shadow_share / kSeeds;
  }
  EXPECT_GT(overlap, 0.85);
  EXPECT_LT(shadow, 0.03);
}

TEST(GridMap, FinerLabelsAreNoWorse) {
  // Pixels at the edges of a car are exactly half of it more often than by chance: labels are of 2 x 2 rays.
  constexpr std::uint32_t kSeeds = 4;
  double overlaps[] = {0.0, 0.0, 0.0};
  const int sizes[] = {56, 112, 224};
  for (int k = 0; k < 3; ++k) {
    for (std::uint32_t seed = 1; seed <= kSeeds; ++seed) {
      const GridCase given = make_grid_case("single", seed);
      overlaps[k] += score(given, map_of(given, sizes[k], flat_ground()).grid()).intersection_over_union / kSeeds;
    }
  }
  EXPECT_GT(overlaps[2], 0.9);
  EXPECT_GT(overlaps[2], overlaps[0]);
  EXPECT_GT(overlaps[1], overlaps[0]);
}

TEST(GridMap, FindsTheCommonErrorOfTheElevationByCarsSeenFromSeveralPlaces) {
  GridCase given = make_grid_case("orbit", 1);
  for (std::size_t i = 1; i < given.T_world_camera.size(); ++i) {  // every second image
    given.T_world_camera.erase(given.T_world_camera.begin() + static_cast<std::ptrdiff_t>(i));
  }
  std::vector<SoftLabels> labels;
  for (std::size_t i = 0; i < given.T_world_camera.size(); ++i)
    labels.push_back(labels_of(given, square_camera(56), i, 1));
  for (const double error_m : {-1.0, 0.0, 1.0}) {
    GridMap map(GridMapParams{}, flat_ground(error_m));
    for (std::size_t i = 0; i < labels.size(); ++i) map.update(labels[i], given.T_world_camera[i]);
    EXPECT_EQ(map.elevation_offset_m(), -error_m);
    EXPECT_GT(score(given, map.grid()).intersection_over_union, 0.8) << error_m;
  }
}

TEST(GridMap, ImagesTooCoarseToShowACarDoNotTakeItAway) {
  constexpr int kImages = 120;
  const GridCase given = make_grid_case("orbit", 1);
  GridMap map(GridMapParams{}, flat_ground());
  for (std::size_t i = 0; i < given.T_world_camera.size(); i += 4) {
    map.update(labels_of(given, square_camera(56), i, 1), given.T_world_camera[i]);
  }
  EXPECT_GT(score(given, map.grid()).intersection_over_union, 0.75);
  // From 160 m a car's height is less than half a pixel, and the labels have nothing.
  for (int i = 0; i < kImages; ++i) {
    map.update(uniform_labels(0.0F), camera_pose({-160.0, i - 0.5 * kImages, 40.0}, 0.0, radians(-14.0)));
  }
  EXPECT_GT(score(given, map.grid()).intersection_over_union, 0.75);
  // From 30 m it is.
  for (int i = 0; i < kImages; ++i) {
    map.update(uniform_labels(0.0F), camera_pose({-30.0, 0.0, 20.0}, 0.0, radians(-33.0)));
  }
  EXPECT_LT(score(given, map.grid()).intersection_over_union, 0.3);
}

TEST(GridMap, MovesWithTheWorldByWholeTiles) {
  GridCase given = make_grid_case("single", 3);
  const SemanticGrid here = map_of(given, 56, flat_ground()).grid();
  const Eigen::Vector3d step_m(32.0, -48.0, 0.0);
  const SoftLabels labels = labels_of(given, square_camera(56), 0, 1);
  Eigen::Isometry3d T = given.T_world_camera[0];
  T.translation() += step_m;
  GridMap map(GridMapParams{}, flat_ground());
  map.update(labels, T);
  const SemanticGrid there = map.grid();
  ASSERT_EQ(there.width, here.width);
  ASSERT_EQ(there.height, here.height);
  EXPECT_EQ(there.first_column, here.first_column + 64);
  EXPECT_EQ(there.first_row, here.first_row - 96);
  EXPECT_EQ(there.images, here.images);
  for (std::size_t i = 0; i < here.probability.size(); ++i) {
    if (std::isnan(here.probability[i])) {
      EXPECT_TRUE(std::isnan(there.probability[i]));
    } else {
      EXPECT_NEAR(there.probability[i], here.probability[i], 1e-3);
    }
  }
}

TEST(GridMap, UnknownLabelsAreNoEvidence) {
  for (const float unknown : {0.5F, std::numeric_limits<float>::quiet_NaN()}) {
    GridMap map(GridMapParams{}, flat_ground());
    EXPECT_EQ(map.update(uniform_labels(unknown), kPose).observed_cells, 0U);
    EXPECT_EQ(map.grid().width, 0);
  }
}

TEST(GridMap, AnEdgeOfExactlyAHalfIsEvidenceAndAnUnknownPartIsNot) {
  // To the left of the class, to the right not known, with a column of a half in between.
  SoftLabels labels = uniform_labels(0.5F);
  for (int v = 0; v < 56; ++v) {
    for (int u = 0; u < 30; ++u) labels.probability[static_cast<std::size_t>(v * 56 + u)] = u < 20 ? 0.0F : 1.0F;
    labels.probability[static_cast<std::size_t>(v * 56 + 20)] = 0.5F;  // between less and more
  }
  GridMap map(GridMapParams{}, flat_ground());
  map.update(labels, kPose);
  const SemanticGrid grid = map.grid();
  for (int row = 0; row < grid.height; ++row) {
    for (int column = 0; column < grid.width; ++column) {
      const Eigen::Vector3d p = kPose.inverse() * Eigen::Vector3d(grid.middle_world_m(column, row).x(),
                                                                  grid.middle_world_m(column, row).y(), 0.0);
      const double u = labels.camera.fx_px * p.x() / p.z() + labels.camera.cx_px;
      const bool is_observed = grid.images[grid.index(column, row)] > 0;
      if (u > 30.0) {
        EXPECT_FALSE(is_observed) << u;
      }
      if (p.z() > 30.0 && p.z() < 60.0 && u > 18.5 && u < 28.5 && std::abs(p.y() / p.z()) < 0.4) {
        EXPECT_TRUE(is_observed) << u;
      }
    }
  }
}

TEST(GridMap, GroundBehindACrestIsNotObserved) {
  std::vector<float> heights(200 * 4, 0.0F);
  for (std::size_t row = 0; row < 4; ++row) heights[row * 200 + 60] = 12.0F;  // a wall of ground at x = 60 to 61 m
  const auto wall =
      std::make_shared<Elevation>(200, 4, Eigen::Vector2d(0.0, 100.0), Eigen::Vector2d(1.0, 50.0), heights);
  GridMap map(GridMapParams{}, wall);
  map.update(uniform_labels(0.0F), kPose);
  const SemanticGrid grid = map.grid();
  EXPECT_LT(probability_at(grid, 50.25, 0.25), 0.5F);
  EXPECT_TRUE(std::isnan(probability_at(grid, 70.25, 0.25)));
  EXPECT_TRUE(std::isnan(probability_at(grid, 120.25, 0.25)));  // the sight line over the crest ends at 150 m
  EXPECT_LT(probability_at(grid, 170.25, 0.25), 0.5F);
}

std::size_t class_cells(const SemanticGrid& grid, double x_min, double x_max, double y_min, double y_max) {
  std::size_t cells = 0;
  for (int row = 0; row < grid.height; ++row) {
    for (int column = 0; column < grid.width; ++column) {
      const Eigen::Vector2d p_m = grid.middle_world_m(column, row);
      if (p_m.x() < x_min || p_m.x() > x_max || p_m.y() < y_min || p_m.y() > y_max) continue;
      cells += grid.probability[grid.index(column, row)] > 0.5F ? 1U : 0U;
    }
  }
  return cells;
}

TEST(GridMap, WhatIsAboveTheGroundIsNotOnIt) {
  for (const double bottom_m : {3.0, 5.0, 8.0}) {
    GridCase given = make_grid_case("orbit", 1);
    given.scene.signs.push_back({Pose2{{9.0, 16.0}, radians(60.0)}, {0.2, 4.0, 1.5}, bottom_m});
    EXPECT_EQ(class_cells(map_of(given, 56, flat_ground()).grid(), -100.0, 100.0, 10.0, 100.0), 0U) << bottom_m;
  }
}

TEST(GridMap, TheShadowOnGroundThatFallsAwayAsTheSightLinesDoIsNotSeen) {
  GridCase given;
  given.scene.ground = [](double x, double) { return -0.2 * x; };
  given.scene.steepest = 0.2;
  given.scene.cars.push_back({Pose2{{4.0, 0.0}, radians(90.0)}});
  for (int i = 0; i < 20; ++i) {  // from where the ground behind the car falls away nearly as the sight lines do
    given.T_world_camera.push_back(camera_pose({-70.0 + i, 0.0, 22.0 - 0.2 * i}, 0.0, radians(-15.0)));
  }
  const SemanticGrid grid = map_of(given, 112, std::make_shared<Elevation>(elevation_of(given, 1.0, 1))).grid();
  EXPECT_GT(class_cells(grid, 2.0, 7.0, -3.0, 3.0), 8U);
  EXPECT_EQ(class_cells(grid, 9.0, 100.0, -20.0, 20.0), 0U);
  EXPECT_TRUE(std::isnan(probability_at(grid, 15.25, 0.25)));
}

TEST(GridMap, TheGroundBehindACarOnACrestIsNotOfTheClass) {
  // The sight lines over the car reach the ground 60 m behind the crest.
  GridCase given;
  given.scene.ground = [](double x, double) { return 10.0 * std::exp(-x * x / 200.0); };
  given.scene.steepest = 0.7;
  given.scene.cars.push_back({Pose2{{1.0, 0.0}, radians(90.0)}});
  for (int i = 0; i < 10; ++i) {
    given.T_world_camera.push_back(camera_pose({-80.0 + 0.5 * i, 0.0, 22.0}, 0.0, radians(-10.0)));
  }
  const SemanticGrid grid = map_of(given, 112, std::make_shared<Elevation>(elevation_of(given, 1.0, 1))).grid();
  EXPECT_GT(class_cells(grid, -2.0, 4.0, -3.0, 3.0), 8U);
  EXPECT_EQ(class_cells(grid, 10.0, 200.0, -50.0, 50.0), 0U);
}

TEST(GridMap, OneImageOfManyIsNotBelievedWhereNoOtherLooked) {
  GridMap map(GridMapParams{}, flat_ground());
  for (int i = 0; i < 5; ++i) map.update(uniform_labels(0.0F), kPose);
  Eigen::Isometry3d back = camera_pose({0.0, 0.0, 20.0}, radians(180.0), radians(-20.0));
  map.update(uniform_labels(1.0F), back);
  EXPECT_EQ(class_cells(map.grid(), -100.0, 0.0, -100.0, 100.0), 0U);
  for (int i = 0; i < 3; ++i) map.update(uniform_labels(1.0F), back);
  EXPECT_GT(class_cells(map.grid(), -100.0, 0.0, -100.0, 100.0), 0U);
}

TEST(GridMap, ObservesNothingBeyondItsElevationOrItsReach) {
  const auto near = std::make_shared<Elevation>(1, 1, Eigen::Vector2d(0.0, 50.0), Eigen::Vector2d(60.0, 100.0),
                                                std::vector<float>{0.0F});
  GridMap map(GridMapParams{}, near);
  map.update(uniform_labels(0.0F), kPose);
  EXPECT_TRUE(std::isnan(probability_at(map.grid(), 60.25, 0.25)));
  EXPECT_FALSE(std::isnan(probability_at(map.grid(), 59.75, 0.25)));
  GridMapParams params;
  params.reach_m = 50.0;
  GridMap short_one(params, flat_ground());
  short_one.update(uniform_labels(0.0F), kPose);
  EXPECT_TRUE(std::isnan(probability_at(short_one.grid(), 50.25, 0.25)));
  EXPECT_FALSE(std::isnan(probability_at(short_one.grid(), 49.25, 0.25)));
}

TEST(GridMap, ForgetsWhatIsFarAway) {
  GridMap map(GridMapParams{}, flat_ground());
  map.update(uniform_labels(0.0F), kPose);
  map.keep_around({0.0, 0.0}, 60.0);
  const SemanticGrid grid = map.grid();
  EXPECT_FALSE(std::isnan(probability_at(grid, 55.25, 0.25)));
  EXPECT_LE((grid.first_column + grid.width) * grid.cell_m, 60.0 + 16.0);
}

TEST(GridMap, RefusesBadInputAndIsUnchanged) {
  GridMap map(GridMapParams{}, flat_ground());
  SoftLabels short_one = uniform_labels(0.0F);
  short_one.probability.pop_back();
  EXPECT_THROW(map.update(short_one, kPose), std::invalid_argument);
  SoftLabels no_camera = uniform_labels(0.0F);
  no_camera.camera.fx_px = 0.0;
  EXPECT_THROW(map.update(no_camera, kPose), std::invalid_argument);
  Eigen::Isometry3d nowhere = kPose;
  nowhere.translation().x() = std::nan("");
  EXPECT_THROW(map.update(uniform_labels(0.0F), nowhere), std::invalid_argument);
  for (const double far : {1.1e6, -1e53, 1e300}) {  // found by fuzzing
    nowhere.translation().x() = far;
    EXPECT_THROW(map.update(uniform_labels(0.0F), nowhere), std::invalid_argument);
    no_camera.camera.fx_px = std::abs(far);
    EXPECT_THROW(map.update(no_camera, kPose), std::invalid_argument);
    no_camera.camera.fx_px = 50.0;
    no_camera.camera.cy_px = far;
    EXPECT_THROW(map.update(no_camera, kPose), std::invalid_argument);
    no_camera.camera.cy_px = 0.0;
  }
  EXPECT_EQ(map.grid().width, 0);
  GridMapParams params;
  params.cell_m = 0.0;
  EXPECT_THROW(GridMap(params, flat_ground()), std::invalid_argument);
  EXPECT_THROW(GridMap(GridMapParams{}, nullptr), std::invalid_argument);
}

TEST(DropOutOfRange, MakesThemUnknownAndCountsThem) {
  SoftLabels labels = uniform_labels(0.25F);
  labels.probability[3] = 1.5F;
  labels.probability[4] = -0.1F;
  labels.probability[5] = std::numeric_limits<float>::infinity();
  labels.probability[6] = std::numeric_limits<float>::quiet_NaN();
  EXPECT_EQ(drop_out_of_range(labels), 3U);
  for (std::size_t i = 3; i < 7; ++i) EXPECT_TRUE(std::isnan(labels.probability[i]));
  EXPECT_EQ(labels.probability[7], 0.25F);
}

}  // namespace
}  // namespace situation_awareness::grid_map_test

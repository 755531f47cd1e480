// SPDX-License-Identifier: BSD-3-Clause
#include "situation_awareness/points/points.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <limits>

#include "situation_awareness/points/horizontal_projection.hpp"
#include "situation_awareness/scan/range_limiter.hpp"
#include "support/level_scene.hpp"

namespace situation_awareness::points_test {
namespace {

TEST(FreeSpace, ReachesAsFarAsEachBeam) {
  Scan scan;
  scan.angle_min_rad = -0.2;
  scan.angle_increment_rad = 0.1;
  scan.beams = {{2.0F, BeamState::kHit},      {9.0F, BeamState::kOutside},
                {30.0F, BeamState::kFree},    {std::numeric_limits<float>::infinity(), BeamState::kFree},
                {0.0F, BeamState::kTooClose}, {0.0F, BeamState::kInvalid}};
  const FreeSpace free = free_space(project_horizontally(scan, Eigen::Isometry3d::Identity()));
  const std::vector<float> expected_m = {2.0F, 9.0F, 30.0F, std::numeric_limits<float>::infinity(), 0.0F, 0.0F};
  ASSERT_EQ(free.azimuth_rad.size(), expected_m.size());
  ASSERT_EQ(free.range_m.size(), expected_m.size());
  for (std::size_t i = 0; i < expected_m.size(); ++i) {
    EXPECT_EQ(free.range_m[i], expected_m[i]);
    EXPECT_NEAR(free.azimuth_rad[i], -0.2 + 0.1 * static_cast<double>(i), 1e-6);
  }
  EXPECT_FALSE(free.full_circle);
  EXPECT_TRUE(free_space(Points{}).azimuth_rad.empty());
}

// Free space is never inside an object or behind it, for any volume of interest.
TEST(FreeSpace, IsFree) {
  LevelScene scene;
  scene.ellipses = {{{3.0, 0.5}, 0.4, 0.5, 0.2}, {{1.0, -1.5}, 0.0, 0.3, 0.3}};
  scene.walls = {{{6.0, -9.0}, {6.0, 9.0}}};
  RangeLimiterParams limits;
  limits.max_range_m = 2.0;
  const Eigen::Isometry3d T_world_lidar = Eigen::Isometry3d::Identity();
  const FreeSpace free =
      free_space(project_horizontally(limit_range(scene.scan(), T_world_lidar, limits), T_world_lidar));
  for (std::size_t i = 0; i < free.range_m.size(); ++i) {
    const double azimuth_rad = free.azimuth_rad[i];
    const Eigen::Vector2d u(std::cos(azimuth_rad), std::sin(azimuth_rad));
    double truth_m = std::numeric_limits<double>::infinity();
    for (const Ellipse& ellipse : scene.ellipses) {
      if (const auto hit = intersect_ray(ellipse, Eigen::Vector2d::Zero(), u)) truth_m = std::min(truth_m, *hit);
    }
    if (u.x() > 0.0 && std::abs(6.0 * u.y() / u.x()) <= 9.0) truth_m = std::min(truth_m, 6.0 / u.x());
    EXPECT_NEAR(free.range_m[i], std::min(truth_m, scene.max_range_m), 1e-3) << i;
  }
}

}  // namespace
}  // namespace situation_awareness::points_test

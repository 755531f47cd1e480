// SPDX-License-Identifier: BSD-3-Clause
#include "situation_awareness/segments/range_noise.hpp"

#include <gtest/gtest.h>

#include <cmath>

#include "situation_awareness/common/random.hpp"
#include "situation_awareness/geometry/angles.hpp"
#include "situation_awareness/points/horizontal_projection.hpp"
#include "situation_awareness/segments/segmentation.hpp"
#include "support/level_scene.hpp"

namespace situation_awareness::range_noise_test {
namespace {

/// A room with things in it.
LevelScene furnished_room(double increment_rad) {
  LevelScene scene;
  scene.angle_min_rad = -0.75 * kPi;
  scene.angle_increment_rad = increment_rad;
  scene.beams = static_cast<int>(1.5 * kPi / increment_rad);
  scene.ellipses = {{{2.0, 0.5}, 0.3, 0.4, 0.2}, {{1.5, -1.5}, 0.0, 0.15, 0.15}, {{-0.5, 2.5}, 1.0, 0.5, 0.3}};
  const Eigen::Vector2d a(5.0, -4.0), b(5.0, 4.0), c(-5.0, 4.0), d(-5.0, -4.0);
  scene.walls = {{a, b}, {b, c}, {c, d}, {d, a}};
  return scene;
}

double sigma_seen_m(const LevelScene& scene, Random* random = nullptr, double sigma_m = 0.0) {
  const Points points = project_horizontally(scene.scan(random, sigma_m), Eigen::Isometry3d::Identity());
  return RangeNoise().sigma_m(segment(points, SegmentationParams()));
}

TEST(RangeNoise, IsThatOfTheScanner) {
  Random random(1);
  for (const double increment_deg : {0.25, 0.5, 1.0}) {
    for (const double sigma_m : {0.005, 0.01, 0.03}) {
      double sum_m = 0.0;
      constexpr int kScans = 10;
      for (int i = 0; i < kScans; ++i) {
        sum_m += sigma_seen_m(furnished_room(radians(increment_deg)), &random, sigma_m);
      }
      EXPECT_NEAR(sum_m / kScans, sigma_m, 0.1 * sigma_m) << increment_deg << " deg";
    }
  }
}

TEST(RangeNoise, SurfacesHaveNone) {
  for (const double increment_deg : {0.25, 0.5, 1.0}) {
    EXPECT_LT(sigma_seen_m(furnished_room(radians(increment_deg))), 3e-4) << increment_deg << " deg";
  }
}

TEST(RangeNoise, IsUnknownFromFewHits) {
  LevelScene scene;
  scene.ellipses = {{{4.0, 0.0}, 0.0, 0.2, 0.2}};
  EXPECT_EQ(sigma_seen_m(scene), 0.0);
  EXPECT_EQ(RangeNoise().sigma_m(Segments()), 0.0);
}

}  // namespace
}  // namespace situation_awareness::range_noise_test

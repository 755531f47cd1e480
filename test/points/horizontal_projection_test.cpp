// SPDX-License-Identifier: BSD-3-Clause
#include "situation_awareness/points/horizontal_projection.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <limits>

#include "situation_awareness/common/random.hpp"
#include "situation_awareness/geometry/angles.hpp"

namespace situation_awareness::horizontal_projection_test {
namespace {

Scan random_scan(Random& random, double increment_rad = radians(0.25), int beams = 1081) {
  Scan scan;
  scan.stamp_ns = 5;
  scan.angle_min_rad = -increment_rad * (beams - 1) / 2.0;
  scan.angle_increment_rad = increment_rad;
  for (int i = 0; i < beams; ++i) {
    scan.beams.push_back({static_cast<float>(random.uniform(0.2, 10.0)), BeamState::kHit});
  }
  return scan;
}

Eigen::Isometry3d pose(double roll_rad, double pitch_rad, double yaw_rad) {
  Eigen::Isometry3d T = Eigen::Isometry3d::Identity();
  T.translation() << 1.0, -2.0, 1.5;
  T.rotate(Eigen::AngleAxisd(yaw_rad, Eigen::Vector3d::UnitZ()) *
           Eigen::AngleAxisd(pitch_rad, Eigen::Vector3d::UnitY()) *
           Eigen::AngleAxisd(roll_rad, Eigen::Vector3d::UnitX()));
  return T;
}

TEST(HorizontalProjection, EveryPointIsAboveOrBelowTheOneMeasured) {
  Random random(1);
  for (const auto& [roll, pitch] : {std::pair{0.0, 0.0}, {0.2, 0.0}, {0.0, -0.3}, {0.25, 0.15}, {kPi, 0.1}}) {
    const Eigen::Isometry3d T_world_lidar = pose(roll, pitch, 2.5);
    const Scan scan = random_scan(random);
    const Points points = project_horizontally(scan, T_world_lidar);
    ASSERT_EQ(points.points.size(), scan.beams.size());
    EXPECT_EQ(points.height_world_m, 1.5);
    double previous_rad = -1e9;
    for (const Point& point : points.points) {
      const double angle_rad = scan.angle_min_rad + point.beam * scan.angle_increment_rad;
      const double range_m = scan.beams[static_cast<std::size_t>(point.beam)].range_m;
      const Eigen::Vector3d p_world =
          T_world_lidar * Eigen::Vector3d(range_m * std::cos(angle_rad), range_m * std::sin(angle_rad), 0.0);
      EXPECT_LT((points.T_world_level * point.p_level_m - p_world.head<2>()).norm(), 1e-9);
      EXPECT_NEAR(point.range_m, point.p_level_m.norm(), 1e-12);
      EXPECT_NEAR(std::remainder(point.azimuth_rad - std::atan2(point.p_level_m.y(), point.p_level_m.x()), 2 * kPi),
                  0.0, 1e-9);
      EXPECT_GT(point.azimuth_rad, previous_rad);
      previous_rad = point.azimuth_rad;
    }
  }
}

TEST(HorizontalProjection, EachPointHasTheIntensityOfItsBeam) {
  Random random(4);
  Scan scan = random_scan(random);
  const Points without = project_horizontally(scan, pose(0.1, 0.2, 0.3));
  for (const Point& point : without.points) EXPECT_TRUE(std::isnan(point.intensity));
  for (Beam& beam : scan.beams) beam.intensity = static_cast<float>(random.uniform(0.0, 255.0));
  for (const double roll_rad : {0.1, kPi + 0.1}) {
    const Points points = project_horizontally(scan, pose(roll_rad, 0.2, 0.3), pose(roll_rad, 0.2, 0.31));
    ASSERT_EQ(points.points.size(), scan.beams.size());
    for (const Point& point : points.points) {
      EXPECT_EQ(point.intensity, scan.beams[static_cast<std::size_t>(point.beam)].intensity);
    }
  }
}

TEST(HorizontalProjection, LevelScanIsUnchanged) {
  Random random(2);
  const Scan scan = random_scan(random);
  const Points points = project_horizontally(scan, pose(0.0, 0.0, -0.4));
  EXPECT_NEAR(points.T_world_level.yaw_rad, -0.4, 1e-12);
  EXPECT_NEAR(points.resolution_rad, scan.angle_increment_rad, 1e-12);
  EXPECT_FALSE(points.full_circle);
  for (std::size_t i = 0; i < points.points.size(); ++i) {
    EXPECT_NEAR(points.points[i].range_m, scan.beams[i].range_m, 1e-6);
    EXPECT_NEAR(points.points[i].azimuth_rad, scan.angle_min_rad + static_cast<double>(i) * scan.angle_increment_rad,
                1e-9);
  }
}

TEST(HorizontalProjection, ReversedAndUpsideDownScansGiveTheSamePoints) {
  Random random(3);
  const Scan scan = random_scan(random);
  Scan reversed = scan;
  std::reverse(reversed.beams.begin(), reversed.beams.end());
  reversed.angle_min_rad = scan.angle_min_rad + 1080 * scan.angle_increment_rad;
  reversed.angle_increment_rad = -scan.angle_increment_rad;
  // Mounted upside down (rolled by pi), the same directions come in the opposite order.
  Scan upside_down = reversed;
  upside_down.angle_min_rad = -reversed.angle_min_rad;
  upside_down.angle_increment_rad = -reversed.angle_increment_rad;

  const Points expected = project_horizontally(scan, pose(0.0, 0.1, 0.3));
  const Points from_reversed = project_horizontally(reversed, pose(0.0, 0.1, 0.3));
  const Points from_upside_down = project_horizontally(upside_down, pose(kPi, 0.1, 0.3));
  for (std::size_t i = 0; i < expected.points.size(); ++i) {
    EXPECT_LT((expected.points[i].p_level_m - from_reversed.points[i].p_level_m).norm(), 1e-6);
    EXPECT_LT((expected.points[i].p_level_m - from_upside_down.points[i].p_level_m).norm(), 1e-6);
    EXPECT_NEAR(expected.points[i].azimuth_rad, from_reversed.points[i].azimuth_rad, 1e-9);
    EXPECT_NEAR(expected.points[i].azimuth_rad, from_upside_down.points[i].azimuth_rad, 1e-9);
  }
}

TEST(HorizontalProjection, DetectsAFullCircle) {
  Random random(4);
  EXPECT_TRUE(project_horizontally(random_scan(random, radians(1.0), 360), pose(0, 0, 0)).full_circle);
  EXPECT_TRUE(project_horizontally(random_scan(random, radians(-1.0), 360), pose(0, 0, 0)).full_circle);
  EXPECT_TRUE(project_horizontally(random_scan(random, radians(1.0), 361), pose(0, 0, 0)).full_circle);
  EXPECT_FALSE(project_horizontally(random_scan(random, radians(1.0), 350), pose(0, 0, 0)).full_circle);
}

// Found by fuzz/scan: the azimuths of a segment across the seam stepped back.
TEST(HorizontalProjection, BeamsBeyondAFullCircleAreLeftOut) {
  Random random(5);
  const double overlap_rad = 4e-4;
  const Scan scan = random_scan(random, (2.0 * kPi + overlap_rad) / 76.0, 77);
  for (const double roll_rad : {0.0, kPi}) {
    const Points points = project_horizontally(scan, pose(roll_rad, 0.0, 1.0));
    EXPECT_TRUE(points.full_circle);
    ASSERT_EQ(points.points.size(), 76U);
    EXPECT_LE(points.points.back().azimuth_rad, points.points.front().azimuth_rad + 2.0 * kPi);
  }
}

TEST(HorizontalProjection, BeamStatesStay) {
  Scan scan;
  scan.angle_increment_rad = 0.1;
  scan.beams = {{30.0F, BeamState::kFree},
                {0.0F, BeamState::kTooClose},
                {0.0F, BeamState::kInvalid},
                {2.0F, BeamState::kOutside}};
  const Points points = project_horizontally(scan, pose(0.1, 0.1, 0.0));
  for (std::size_t i = 0; i < scan.beams.size(); ++i) EXPECT_EQ(points.points[i].state, scan.beams[i].state);
}

// A beam without a return has the same horizontal reach as one with a hit there.
TEST(HorizontalProjection, FreeBeamsReachAsFarAsAHit) {
  Scan scan;
  scan.angle_increment_rad = 0.1;
  scan.beams = {{30.0F, BeamState::kFree}, {std::numeric_limits<float>::infinity(), BeamState::kFree}};
  Scan hits = scan;
  hits.beams[0].state = BeamState::kHit;
  for (const double pitch_rad : {0.0, 0.3}) {
    const Points points = project_horizontally(scan, pose(0.1, pitch_rad, 0.2));
    EXPECT_NEAR(points.points[0].range_m, project_horizontally(hits, pose(0.1, pitch_rad, 0.2)).points[0].range_m,
                1e-9);
    EXPECT_TRUE(std::isinf(points.points[1].range_m));
  }
}

// The numbers of docs/math/points.md: a hit 5 m away under pitch by eq. 5 of the circle paper, rho cos(theta) at the
// same azimuth, and its true position.
TEST(HorizontalProjection, EquationFiveMisplacesHits) {
  struct Row {
    double azimuth_deg, pitch_deg, azimuth_error_deg, distance_m;
  };
  for (const Row& row :
       {Row{0, 5, 0, 0}, Row{0, 15, 0, 0}, Row{45, 5, 0.11, 0.013}, Row{45, 10, 0.44, 0.054}, Row{45, 15, 0.99, 0.120},
        Row{90, 5, 0, 0.019}, Row{90, 10, 0, 0.076}, Row{90, 15, 0, 0.170}}) {
    Scan scan;
    scan.angle_min_rad = radians(row.azimuth_deg);
    scan.angle_increment_rad = 0.01;
    scan.beams.assign(2, {5.0F, BeamState::kHit});
    const Point exact = project_horizontally(scan, pose(0.0, radians(row.pitch_deg), 0.0)).points[0];
    const double range_m = 5.0 * std::cos(radians(row.pitch_deg));
    const Eigen::Vector2d by_equation_five(range_m * std::cos(scan.angle_min_rad),
                                           range_m * std::sin(scan.angle_min_rad));
    EXPECT_NEAR((exact.p_level_m - by_equation_five).norm(), row.distance_m, 6e-4);
    EXPECT_NEAR(degrees(exact.azimuth_rad) - row.azimuth_deg, row.azimuth_error_deg, 6e-3);
  }
}

TEST(HorizontalProjection, RefusesAScanPlaneOnEdge) {
  Random random(5);
  const Scan scan = random_scan(random);
  EXPECT_THROW(project_horizontally(scan, pose(kPi / 2.0, 0.0, 0.0)), std::invalid_argument);
  EXPECT_NEAR(tilt_rad(pose(0.3, 0.0, 1.0)), 0.3, 1e-12);
  EXPECT_NEAR(tilt_rad(pose(kPi + 0.3, 0.0, 1.0)), 0.3, 1e-12);
}

}  // namespace
}  // namespace situation_awareness::horizontal_projection_test

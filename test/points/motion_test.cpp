// SPDX-License-Identifier: BSD-3-Clause
// project_horizontally for a lidar that moves during the scan.
#include <gtest/gtest.h>

#include <cmath>
#include <limits>
#include <set>

#include "situation_awareness/common/random.hpp"
#include "situation_awareness/geometry/angles.hpp"
#include "situation_awareness/points/horizontal_projection.hpp"
#include "situation_awareness/segments/segmentation.hpp"
#include "support/moving_lidar.hpp"

namespace situation_awareness::motion_test {
namespace {

Eigen::Isometry3d pose(const Eigen::Vector3d& position_m, double yaw_deg, double pitch_deg = 0.0,
                       double roll_deg = 0.0) {
  Eigen::Isometry3d T = Eigen::Isometry3d::Identity();
  T.translation() = position_m;
  T.rotate(Eigen::AngleAxisd(radians(yaw_deg), Eigen::Vector3d::UnitZ()) *
           Eigen::AngleAxisd(radians(pitch_deg), Eigen::Vector3d::UnitY()) *
           Eigen::AngleAxisd(radians(roll_deg), Eigen::Vector3d::UnitX()));
  return T;
}

/// A room of four walls with two round objects in it, and a lidar that flies and turns fast: 3 m/s and 160 deg/s.
MovingLidar fast_in_a_room() {
  MovingLidar lidar;
  lidar.walls_world = {
      {{1.0, 0.0}, 5.0}, {{-1.0, 0.0}, 4.0}, {{0.0, 1.0}, 4.5}, {{std::sqrt(0.5), -std::sqrt(0.5)}, 4.0}};
  lidar.ellipses_world = {{{2.5, 0.7}, 0.0, 0.3, 0.3}, {{0.5, -1.8}, 0.4, 0.4, 0.2}};
  lidar.T_world_lidar = pose({0.2, -0.1, 1.0}, 20.0, 4.0, -6.0);
  lidar.T_world_lidar_end = pose({0.25, -0.07, 1.01}, 23.0, 4.5, -5.0);
  return lidar;
}

Points project(const MovingLidar& lidar) {
  return project_horizontally(lidar.scan(), lidar.T_world_lidar, lidar.T_world_lidar_end);
}

double polar_rad(const Point& point) { return std::atan2(point.p_level_m.y(), point.p_level_m.x()); }

/// Invariants for any motion of the lidar: points are at the hits, and azimuths are non-decreasing.
void check_truth(const MovingLidar& lidar, const Points& points) {
  const std::vector<Eigen::Vector2d> hits_world_m = lidar.hits_world_m();
  double previous_rad = points.points.front().azimuth_rad;
  for (const Point& point : points.points) {
    EXPECT_GE(point.azimuth_rad, previous_rad);
    previous_rad = point.azimuth_rad;
    if (point.state != BeamState::kHit) continue;
    const Eigen::Vector2d p_world_m = points.T_world_level * point.p_level_m;
    EXPECT_LT((p_world_m - hits_world_m[static_cast<std::size_t>(point.beam)]).norm(), 1e-6) << point.beam;
    EXPECT_NEAR(point.range_m, point.p_level_m.norm(), 1e-12);
  }
  EXPECT_LE(points.points.back().azimuth_rad, points.points.front().azimuth_rad + 2.0 * kPi + 1e-12);
}

TEST(Motion, StandingObjectsAreUndistorted) {
  for (const double roll_deg : {-6.0, 174.0}) {         // mounted upright and upside down
    for (const double increment_deg : {0.25, -0.25}) {  // turning either way
      for (const int beams : {1081, 1440}) {            // a part of a turn, and all of it
        MovingLidar lidar = fast_in_a_room();
        lidar.T_world_lidar = pose({0.2, -0.1, 1.0}, 20.0, 4.0, roll_deg);
        lidar.T_world_lidar_end = pose({0.25, -0.07, 1.01}, 23.0, 4.5, roll_deg + 1.0);
        lidar.angle_increment_rad = radians(increment_deg);
        lidar.angle_min_rad = -0.5 * (beams - 1) * lidar.angle_increment_rad;
        lidar.beams = beams;
        const Points points = project(lidar);
        check_truth(lidar, points);
        EXPECT_EQ(points.full_circle, beams == 1440);
        EXPECT_NEAR(points.resolution_rad, radians(0.25), 0.02 * radians(0.25));
        EXPECT_EQ(points.time_increment_s, lidar.time_increment_s);
        EXPECT_LT((points.T_world_level.translation_m - Eigen::Vector2d(0.2, -0.1)).norm(), 1e-12);
        EXPECT_EQ(points.height_world_m, 1.0);
      }
    }
  }
}

TEST(Motion, BothEndsAreExact) {
  const MovingLidar lidar = fast_in_a_room();
  const Scan scan = lidar.scan();
  const Points points = project(lidar);
  for (const auto& [point, T_world_lidar] : {std::pair{points.points.front(), lidar.T_world_lidar},
                                             std::pair{points.points.back(), lidar.T_world_lidar_end}}) {
    const double angle_rad = scan.angle_min_rad + point.beam * scan.angle_increment_rad;
    const double range_m = scan.beams[static_cast<std::size_t>(point.beam)].range_m;
    const Eigen::Vector3d p_world =
        T_world_lidar * Eigen::Vector3d(range_m * std::cos(angle_rad), range_m * std::sin(angle_rad), 0.0);
    EXPECT_LT((points.T_world_level * point.p_level_m - p_world.head<2>()).norm(), 1e-12);
  }
}

TEST(Motion, WithoutMotionIsBitForBitTheSame) {
  Random random(1);
  for (const int beams : {361, 1081}) {
    MovingLidar lidar = fast_in_a_room();
    lidar.T_world_lidar_end = lidar.T_world_lidar;
    lidar.beams = beams;
    lidar.angle_increment_rad = beams == 361 ? radians(1.0) : radians(0.25);
    const Scan scan = lidar.scan();
    const Points still = project_horizontally(scan, lidar.T_world_lidar);
    const Points same = project_horizontally(scan, lidar.T_world_lidar, lidar.T_world_lidar);
    Eigen::Isometry3d hardly = lidar.T_world_lidar;
    hardly.translation().x() += 1e-9;
    hardly.rotate(Eigen::AngleAxisd(1e-9, Eigen::Vector3d::UnitZ()));
    const Points nearly = project_horizontally(scan, lidar.T_world_lidar, hardly);
    ASSERT_EQ(same.points.size(), still.points.size());
    EXPECT_EQ(same.resolution_rad, still.resolution_rad);
    for (std::size_t i = 0; i < still.points.size(); ++i) {
      EXPECT_EQ(same.points[i].azimuth_rad, still.points[i].azimuth_rad);
      EXPECT_EQ(same.points[i].p_level_m, still.points[i].p_level_m);
      EXPECT_EQ(same.points[i].range_m, still.points[i].range_m);
      if (i >= nearly.points.size()) continue;
      EXPECT_NEAR(nearly.points[i].azimuth_rad, still.points[i].azimuth_rad, 1e-8);
      EXPECT_LT((nearly.points[i].p_level_m - still.points[i].p_level_m).norm(), 1e-7);
    }
    EXPECT_GE(nearly.points.size() + 1, still.points.size());
  }
}

// Flying sideways, a lidar still sees a part of the wall that a post has covered, seen from where it started.
TEST(Motion, NearerPointsKeepTheirAzimuthsAndCoverFartherOnes) {
  for (const double sideways_m : {0.1, -0.1}) {
    MovingLidar lidar;
    lidar.walls_world = {{{1.0, 0.0}, 8.0}};
    lidar.ellipses_world = {{{0.8, 0.0}, 0.0, 0.1, 0.1}};
    lidar.angle_min_rad = radians(-60.0);
    lidar.beams = 481;
    lidar.T_world_lidar_end = pose({0.0, sideways_m, 0.0}, 0.0);
    const Points points = project(lidar);
    check_truth(lidar, points);
    double post_right_rad = kPi;
    double post_left_rad = -kPi;
    for (const Point& point : points.points) {
      if (point.range_m > 1.0) continue;
      EXPECT_NEAR(point.azimuth_rad, polar_rad(point), 1e-12);
      post_right_rad = std::min(post_right_rad, point.azimuth_rad);
      post_left_rad = std::max(post_left_rad, point.azimuth_rad);
    }
    EXPECT_GT(post_left_rad - post_right_rad, 1.6 * std::asin(0.1 / 0.8));
    int covered = 0;
    for (const Point& point : points.points) {
      if (point.range_m <= 1.0) continue;
      const double true_rad = polar_rad(point);
      if (true_rad > post_right_rad && true_rad < post_left_rad) {
        ++covered;
        EXPECT_TRUE(point.azimuth_rad == post_right_rad || point.azimuth_rad == post_left_rad);
      } else {
        EXPECT_NEAR(point.azimuth_rad, true_rad, 1e-12);
      }
    }
    // By the time of the post, half of the scan, the lidar has moved by 5 cm: 3.6 deg at the post and 0.4 at the wall.
    EXPECT_NEAR(covered * 0.25, 3.2, 0.5);
  }
}

// Turning with its beams a lidar sees a part of its surroundings twice, turning against them it leaves one out.
TEST(Motion, AFullCircleStaysOne) {
  for (const double turn_deg : {8.0, -8.0}) {
    MovingLidar lidar = fast_in_a_room();
    lidar.T_world_lidar = pose({0.0, 0.0, 0.0}, 0.0);
    lidar.T_world_lidar_end = pose({0.02, 0.0, 0.0}, turn_deg);
    lidar.angle_min_rad = -kPi;
    lidar.beams = 1440;
    lidar.ellipses_world = {{{-2.0, 0.05}, 0.0, 0.3, 0.3}};  // across the seam
    const Points points = project(lidar);
    check_truth(lidar, points);
    EXPECT_TRUE(points.full_circle);
    EXPECT_EQ(points.points.size() < 1440, turn_deg > 0.0);
    EXPECT_NEAR(points.resolution_rad, radians(0.25 * (360.0 + turn_deg) / 360.0), 1e-5);

    const Segments segments = segment(points, SegmentationParams{});
    int objects = 0;
    for (const Segment& piece : segments.segments) {
      if (piece.kind != SegmentKind::kObject) continue;
      ++objects;
      std::set<int> beams;
      for (std::size_t i = piece.first; i < piece.first + piece.count; ++i) {
        beams.insert(segments.points[i].beam);
        EXPECT_TRUE(i == piece.first || segments.points[i].azimuth_rad >= segments.points[i - 1].azimuth_rad);
      }
      EXPECT_EQ(beams.size(), piece.count);
      EXPECT_NEAR(static_cast<double>(piece.count) * degrees(points.resolution_rad),
                  degrees(2.0 * std::asin(0.15)) - (turn_deg < 0.0 ? 8.0 : 0.0), 0.8);
    }
    EXPECT_EQ(objects, 1);
  }
}

TEST(Motion, AnyRangesGiveGrowingAzimuths) {
  Random random(2);
  for (int trial = 0; trial < 200; ++trial) {
    Scan scan;
    const bool circle = trial % 2 == 0;
    scan.angle_increment_rad = (trial % 4 < 2 ? 1.0 : -1.0) * radians(circle ? 1.0 : 0.7);
    scan.angle_min_rad = random.uniform(-4.0, 4.0);
    for (int i = 0; i < 360; ++i) {
      const double kind = random.uniform();
      scan.beams.push_back(kind < 0.1   ? Beam{30.0F, BeamState::kFree}
                           : kind < 0.2 ? Beam{0.0F, BeamState::kInvalid}
                                        : Beam{static_cast<float>(random.uniform(0.1, 10.0)), BeamState::kHit});
    }
    const auto any = [&](double yaw_deg) {
      return pose({random.uniform(-0.1, 0.1), random.uniform(-0.1, 0.1), random.uniform(-0.1, 0.1)}, yaw_deg,
                  random.uniform(-3.0, 3.0), random.uniform(-3.0, 3.0) + (trial % 8 < 4 ? 0.0 : 180.0));
    };
    const Points points = project_horizontally(scan, any(50.0), any(50.0 + random.uniform(-15.0, 15.0)));
    EXPECT_EQ(points.full_circle, circle);
    EXPECT_GT(points.resolution_rad, 0.0);
    for (std::size_t i = 1; i < points.points.size(); ++i) {
      ASSERT_GE(points.points[i].azimuth_rad, points.points[i - 1].azimuth_rad);
    }
    ASSERT_LE(points.points.back().azimuth_rad, points.points.front().azimuth_rad + 2.0 * kPi + 1e-9);
  }
}

// Found by fuzz/scan: a negative resolution.
TEST(Motion, BeamsMoreThanHalfATurnApartStayInOrder) {
  Scan scan;
  scan.angle_increment_rad = radians(168.0);
  scan.beams.assign(3, {2.0F, BeamState::kHit});
  Eigen::Isometry3d T_end = Eigen::Isometry3d::Identity();
  T_end.rotate(Eigen::AngleAxisd(radians(30.0), Eigen::Vector3d::UnitZ()));  // 183 degrees from beam to beam
  const Points points = project_horizontally(scan, Eigen::Isometry3d::Identity(), T_end);
  ASSERT_EQ(points.points.size(), 2U);  // the third is beyond a full circle
  EXPECT_NEAR(points.points[1].azimuth_rad - points.points[0].azimuth_rad, radians(183.0), 1e-12);
  EXPECT_NEAR(points.resolution_rad, radians(183.0), 1e-12);
}

TEST(Motion, RefusesMotionThatSwapsBeams) {
  const Scan scan = fast_in_a_room().scan();
  const Eigen::Isometry3d level = pose({0.0, 0.0, 0.0}, 0.0);
  EXPECT_STREQ(projection_defect(scan, level, pose({9.0, 0.0, 0.0}, 26.9)), "");
  EXPECT_STREQ(projection_defect(scan, level, pose({0.0, 0.0, 0.0}, -27.1)), "turn");
  EXPECT_STREQ(projection_defect(scan, pose({0.0, 0.0, 0.0}, 0.0, 60.0), pose({0.0, 0.0, 0.0}, 0.0, 70.0)), "tilt");
  EXPECT_STREQ(projection_defect(scan, pose({0.0, 0.0, 0.0}, 0.0, 70.0), pose({0.0, 0.0, 0.0}, 0.0, 60.0)), "tilt");
  Eigen::Isometry3d nonsense = level;
  nonsense.linear()(0, 1) = std::nan("");
  EXPECT_STREQ(projection_defect(scan, level, nonsense), "pose");
  Eigen::Isometry3d nowhere = level;
  nowhere.translation().y() = std::nan("");
  EXPECT_STREQ(projection_defect(scan, nowhere, nowhere), "pose");
  EXPECT_STREQ(projection_defect(scan, level, nowhere), "pose");
  EXPECT_THROW(project_horizontally(scan, nowhere), std::invalid_argument);
  EXPECT_THROW(project_horizontally(scan, level, pose({0.0, 0.0, 0.0}, 30.0)), std::invalid_argument);
  EXPECT_THROW(project_horizontally(scan, level, pose({0.0, 0.0, 0.0}, 0.0, 70.0)), std::invalid_argument);
}

}  // namespace
}  // namespace situation_awareness::motion_test

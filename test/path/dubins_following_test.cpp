// SPDX-License-Identifier: BSD-3-Clause
#include "situation_awareness/path/dubins_following.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <vector>

#include "path/dubins_paths.hpp"
#include "situation_awareness/path/segment_path.hpp"
#include "support/refusal.hpp"

namespace situation_awareness::dubins_following_test {
namespace {

constexpr double kStep_m = 0.05;  // of a vehicle at 5 m/s, commanded at 100 Hz

Pose2 driven(const Pose2& T, double curvature_1_m, double way_m) {
  const double turn_rad = curvature_1_m * way_m;
  const double half = 0.5 * turn_rad;
  const double chord_m = std::abs(half) > 1e-9 ? way_m * std::sin(half) / half : way_m;
  return T * Pose2{{chord_m * std::cos(half), chord_m * std::sin(half)}, turn_rad};
}

struct Drive {
  double greatest_m = 0.0;    ///< across the path
  double greatest_1_m = 0.0;  ///< curvature
  double at_end_m = 0.0;      ///< from the end of the path, across it
  double at_end_rad = 0.0;
  bool arrived = false;
};

/// Follows the path; the vehicle turns as it is told after `delay` steps.
Drive drive(const DubinsPath& path, const DubinsFollowingParams& params, Pose2 T, int delay = 0) {
  Drive result;
  std::vector<double> commands;  // not yet obeyed
  for (int i = 0; i < delay; ++i) commands.push_back(place_at(path, kStep_m * i).curvature_1_m);
  double way_m = 0.0;
  for (int i = 0; i < static_cast<int>(2.0 * path.length_m / kStep_m) + 2000; ++i) {
    const DubinsFollowingResult told = follow(path, params, T, 5.0, way_m);
    EXPECT_GE(told.way_m, way_m);
    way_m = told.way_m;
    result.greatest_m = std::max(result.greatest_m, std::abs(told.error.across_m));
    result.greatest_1_m = std::max(result.greatest_1_m, std::abs(told.curvature_1_m));
    if (told.arrived) {
      result.arrived = true;
      result.at_end_m = std::abs(told.error.across_m);
      result.at_end_rad = std::abs(told.error.heading_rad);
      break;
    }
    commands.push_back(told.curvature_1_m);
    T = driven(T, commands.front(), kStep_m);
    commands.erase(commands.begin());
  }
  return result;
}

DubinsPath random_path(Random& random, double radius_m) {
  return shortest_dubins_path(random_end(random, 30.0, radius_m), random_end(random, 30.0, radius_m));
}

TEST(DubinsFollowing, StaysOnAPathOfItsOwnRadius) {
  const DubinsFollowingParams params;
  Random random(1);
  for (int i = 0; i < 200; ++i) {
    const DubinsPath path = random_path(random, 1.0 / params.max_curvature_1_m);
    EXPECT_TRUE(may_follow(path, params.max_curvature_1_m));
    const Drive result = drive(path, params, place_at(path, 0.0).pose);
    EXPECT_TRUE(result.arrived) << i;
    // A turn begins up to a step late, and no tighter one makes good for it: two turns over, 2 kStep_m K in heading.
    EXPECT_LT(result.greatest_m, 0.12) << i << name_of(path.word);
    EXPECT_LE(result.greatest_1_m, params.max_curvature_1_m);
  }
}

// A curvature that comes 0.2 s late is made good for by that of the path ahead.
TEST(DubinsFollowing, AnticipatesItsReaction) {
  DubinsFollowingParams params;
  Random random(2);
  double without_m = 0.0, with_m = 0.0;
  for (int i = 0; i < 100; ++i) {
    const DubinsPath path = random_path(random, 1.3 / params.max_curvature_1_m);
    params.reaction_s = 0.0;
    without_m = std::max(without_m, drive(path, params, place_at(path, 0.0).pose, 20).greatest_m);
    params.reaction_s = 0.2;
    with_m = std::max(with_m, drive(path, params, place_at(path, 0.0).pose, 20).greatest_m);
  }
  EXPECT_LT(with_m, 0.1);
  EXPECT_LT(with_m, 0.3 * without_m);
}

TEST(DubinsFollowing, ConvergesFromBesideThePath) {
  const DubinsFollowingParams params;
  const double radius_m = 1.0 / params.max_curvature_1_m;
  Random random(3);
  for (int i = 0; i < 300; ++i) {
    const double path_radius_m = random.uniform(1.3, 2.0) * radius_m;
    // Long enough, with turns of both kinds.
    DubinsPath path;
    do {
      path = random_path(random, path_radius_m);
    } while (path.length_m < 12.0 * radius_m);
    const double across_m = random.uniform(-0.5, 0.5) * radius_m;
    const Pose2 T = place_at(path, 0.0).pose * Pose2{{0.0, across_m}, random.uniform(-0.8, 0.8)};
    const Drive result = drive(path, params, T);
    EXPECT_TRUE(result.arrived) << i;
    EXPECT_LT(result.at_end_m, 0.02 * radius_m) << i << name_of(path.word);
    EXPECT_LT(result.at_end_rad, 0.05) << i;
    EXPECT_LE(result.greatest_1_m, params.max_curvature_1_m);
    // Away from the path by a heading of 0.8 rad, until it has turned by that against the path's own turn.
    const double spare_1_m = params.max_curvature_1_m - 1.0 / path_radius_m;
    EXPECT_LT(result.greatest_m, std::abs(across_m) + (1.0 - std::cos(0.8)) / spare_1_m) << i;
  }
}

// To a line from anywhere, whatever the heading: also from behind its direction.
TEST(DubinsFollowing, ConvergesToALineFromAnyPose) {
  const DubinsFollowingParams params;
  Random random(4);
  const DubinsPath line = shortest_dubins_path({{0.0, 0.0}, 0.0, 6.0}, {{600.0, 0.0}, 0.0, 6.0});
  for (int i = 0; i < 100; ++i) {
    const Pose2 T{{random.uniform(0.0, 30.0), random.uniform(-30.0, 30.0)}, random.uniform(-kPi, kPi)};
    const Drive result = drive(line, params, T);
    EXPECT_TRUE(result.arrived) << i;
    EXPECT_LT(result.at_end_m, 1e-3) << i;
    EXPECT_LT(result.at_end_rad, 1e-3) << i;
    EXPECT_LE(result.greatest_1_m, params.max_curvature_1_m);
  }
}

/// The greatest error across a circle that is followed at 5 m/s through the air, the wind across its first heading.
double greatest_error_in_wind_m(double radius_m, double wind_m_s, const DubinsFollowingParams& params) {
  constexpr double kAirspeed_m_s = 5.0, kTime_s = 0.01;
  const double turn_rate_rad_s = kAirspeed_m_s * params.max_curvature_1_m;
  SegmentPath circle;
  append(circle, DubinsSegment{Arc{{0.0, radius_m}, radius_m, -0.5 * kPi, 2.0 * kPi}});
  const Eigen::Vector2d wind(0.0, wind_m_s);
  double heading_rad = -std::asin(wind_m_s / kAirspeed_m_s);  // of a course along x
  Eigen::Vector2d p_m = Eigen::Vector2d::Zero();
  double way_m = 0.0, greatest_m = 0.0;
  for (double time_s = 0.0; time_s < 100.0; time_s += kTime_s) {
    const Eigen::Vector2d v = kAirspeed_m_s * Eigen::Vector2d(std::cos(heading_rad), std::sin(heading_rad)) + wind;
    const DubinsFollowingResult told = follow(circle, params, {p_m, std::atan2(v.y(), v.x())}, v.norm(), way_m);
    if (told.arrived) return greatest_m;
    way_m = told.way_m;
    greatest_m = std::max(greatest_m, std::abs(told.error.across_m));
    heading_rad += std::clamp(told.curvature_1_m * v.norm(), -turn_rate_rad_s, turn_rate_rad_s) * kTime_s;
    p_m += v * kTime_s;
  }
  ADD_FAILURE() << "not around in 100 s";
  return greatest_m;
}

// Downwind the ground passes faster by 1 + w / V, and a turn of the heading turns the course by less, by as much again.
TEST(DubinsFollowing, TurnsDownwindWithTheSquareOfTheSpeed) {
  DubinsFollowingParams params;
  params.airspeed_m_s = 5.0;
  for (const double wind_m_s : {0.5, 1.0, 1.5}) {
    const double faster = 1.0 + wind_m_s / 5.0, radius_m = 1.0 / params.max_curvature_1_m;
    EXPECT_LT(greatest_error_in_wind_m(1.02 * faster * faster * radius_m, wind_m_s, params), 0.2) << wind_m_s;
    EXPECT_GT(greatest_error_in_wind_m(faster * radius_m, wind_m_s, params), 0.5) << wind_m_s;
    EXPECT_GT(greatest_error_in_wind_m(1.02 * faster * faster * radius_m, wind_m_s, {}), 0.3) << wind_m_s;
  }
}

TEST(DubinsFollowing, CurvatureIsBoundedAndTurnsWithTheFrame) {
  const DubinsFollowingParams params;
  Random random(5);
  for (int i = 0; i < 10'000; ++i) {
    const DubinsEnd from = random_end(random, 20.0, 6.0), to = random_end(random, 20.0, random.uniform(6.0, 12.0));
    const DubinsPath path = shortest_dubins_path(from, to);
    const Pose2 pose{{random.uniform(-50.0, 50.0), random.uniform(-50.0, 50.0)}, random.uniform(-kPi, kPi)};
    const double way_m = random.uniform() * path.length_m;
    const DubinsFollowingResult told = follow(path, params, pose, 5.0, way_m);
    EXPECT_LE(std::abs(told.curvature_1_m), params.max_curvature_1_m);
    const Pose2 T{{random.uniform(-50.0, 50.0), random.uniform(-50.0, 50.0)}, random.uniform(-kPi, kPi)};
    const DubinsPath moved_path = shortest_dubins_path(moved(T, from), moved(T, to));
    if (moved_path.word != path.word) continue;
    const DubinsFollowingResult moved_told = follow(moved_path, params, T * pose, 5.0, way_m);
    EXPECT_NEAR(moved_told.way_m, told.way_m, 1e-6) << i;
    EXPECT_NEAR(moved_told.error.across_m, told.error.across_m, 1e-6) << i;
    // Not where two segments meet; and back from the opposite heading either way is as good.
    const auto curvature = [&](double offset_m) { return place_at(path, told.way_m + offset_m).curvature_1_m; };
    if (curvature(-1e-6) != curvature(1e-6) || moved_told.curvature_1_m == -told.curvature_1_m) continue;
    EXPECT_NEAR(moved_told.curvature_1_m, told.curvature_1_m, 1e-6) << i;
  }
}

TEST(DubinsFollowing, NearestAgreesWithASearch) {
  Random random(6);
  for (int i = 0; i < 500; ++i) {
    const DubinsPath path = random_path(random, 6.0);
    const Eigen::Vector2d p(random.uniform(-40.0, 40.0), random.uniform(-40.0, 40.0));
    const double a_m = random.uniform() * path.length_m, b_m = random.uniform() * path.length_m;
    const double from_m = std::min(a_m, b_m), to_m = std::max(a_m, b_m);
    const double way_m = nearest_m(path, p, from_m, to_m);
    EXPECT_GE(way_m, from_m - 1e-12);
    EXPECT_LE(way_m, to_m + 1e-12);
    const double distance_m = (place_at(path, way_m).pose.translation_m - p).norm();
    for (int k = 0; k <= 1000; ++k) {
      const Pose2 at = place_at(path, from_m + (to_m - from_m) * 1e-3 * k).pose;
      EXPECT_LE(distance_m, (at.translation_m - p).norm() + 1e-9) << i;
    }
  }
}

TEST(DubinsFollowing, KnowsWhichPathItMayFollow) {
  const DubinsPath path = shortest_dubins_path({{0.0, 0.0}, 0.0, 5.0}, {{20.0, 15.0}, 0.5 * kPi, 7.0});
  EXPECT_GT(length_m(path.segments[0]), 0.0);
  EXPECT_FALSE(may_follow(path, 1.0 / 6.0));
  EXPECT_TRUE(may_follow(path, 1.0 / 5.0));
  const DubinsPath line = shortest_dubins_path({{0.0, 0.0}, 0.0, 1.0}, {{20.0, 0.0}, 0.0, 1.0});
  EXPECT_TRUE(may_follow(line, 1.0 / 6.0));
  DubinsFollowingParams params;
  params.max_curvature_1_m = 0.0;
  EXPECT_TRUE(names(refusal_of([&] { params.validate(); }), {"dubins_following.max_curvature_1_m", "0"}));
}

}  // namespace
}  // namespace situation_awareness::dubins_following_test

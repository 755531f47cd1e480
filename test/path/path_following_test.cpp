// SPDX-License-Identifier: BSD-3-Clause
#include "situation_awareness/path/path_following.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <functional>
#include <vector>

#include "situation_awareness/common/params_yaml.hpp"
#include "situation_awareness/common/random.hpp"
#include "situation_awareness/geometry/angles.hpp"
#include "situation_awareness/geometry/lie_groups.hpp"
#include "support/refusal.hpp"

namespace situation_awareness::path_following_test {
namespace {

using State = PathFollowingResult::State;
constexpr std::int64_t kPeriod_ns = 40'000'000;

Path straight(double length_m = 12.0) { return {false, {{{0.0, 0.0}, {}}, {{length_m, 0.0}, {}}}}; }

Path winding() {
  return {false, {{{0.0, 0.0}, {}}, {{2.0, 0.2}, {}}, {{4.0, 1.2}, {}}, {{6.0, 0.3}, {}}, {{8.0, -0.5}, {}}}};
}

Path ring() {
  Path path{true, {}};
  for (int i = 0; i < 8; ++i)
    path.way_points.push_back({{2.0 * std::cos(kPi * i / 4.0), 2.0 * std::sin(kPi * i / 4.0)}, {}});
  return path;
}

/// A vehicle that does as it is told.
struct Drive {
  PathFollowing following;
  Pose2 T;
  std::int64_t stamp_ns = 0;
  std::vector<PathFollowingResult> results{};

  const PathFollowingResult& step(const AllowedMotion& allowed = {10.0, true}) {
    stamp_ns += kPeriod_ns;
    const PathFollowingResult& result = following.update(stamp_ns, T, allowed);
    results.push_back(result);
    const Velocity& u = result.command;
    T = T * exp_se2(0.04 * Eigen::Vector3d(u.speed_m_s, 0.0, u.turn_rate_rad_s));
    return result;
  }

  void run(double seconds) {
    for (int i = 0; i < static_cast<int>(seconds / 0.04); ++i) step();
  }
};

Drive drive(const Path& path, const Pose2& T, const PathFollowingParams& params = {}) {
  Drive drive{PathFollowing(path, {}, params), T};
  drive.following.start();
  return drive;
}

// Eq. 6, with a reference that moves by itself, as printed but for the sign: minus converges, plus does not.
TEST(PathFollowing, ControlConvergesToAMovingReference) {
  for (const double turn_rate_rad_s : {0.0, 0.15}) {
    Pose2 T_reference, T{{-0.2, 0.25}, 0.3};
    const Velocity reference{0.5, turn_rate_rad_s};
    for (int i = 0; i < 4000; ++i) {
      const Velocity u = controlled(following_error(T_reference, T), reference);
      T = T * exp_se2(0.005 * Eigen::Vector3d(u.speed_m_s, 0.0, u.turn_rate_rad_s));
      T_reference = T_reference * exp_se2(0.005 * Eigen::Vector3d(reference.speed_m_s, 0.0, reference.turn_rate_rad_s));
    }
    const FollowingError error = following_error(T_reference, T);
    EXPECT_NEAR(error.along_m, 0.0, 2e-3);
    EXPECT_NEAR(error.across_m, 0.0, 2e-3);
    EXPECT_NEAR(error.heading_rad, 0.0, 2e-3);
  }
}

// docs/math/path.md: V = K2 y^2 / 2 + 1 - cos theta does not grow along the exact motion.
TEST(PathFollowing, LyapunovFunctionDecreases) {
  const auto V = [&](const FollowingError& e) {
    return 0.5 * kGainAcross_1_m2 * e.across_m * e.across_m + 1.0 - std::cos(e.heading_rad);
  };
  for (const Path& path : {straight(), winding(), ring()}) {
    const SplinePath spline(path);
    Random random(5);
    for (int n = 0; n < 20; ++n) {
      double way_m = 1.0;
      Pose2 T = spline.at(way_m).pose() * Pose2{{0.0, random.uniform(-0.4, 0.4)}, random.uniform(-0.8, 0.8)};
      double before = V(following_error(spline.at(way_m).pose(), T));
      for (int i = 0; i < 3000; ++i) {
        way_m = spline.nearest_m(T.translation_m, way_m);
        const PathPoint reference = spline.at(way_m);
        const FollowingError error = following_error(reference.pose(), T);
        EXPECT_LE(V(error), before + 2e-6);
        before = V(error);
        const double ahead_m_s = 0.5 * std::cos(error.heading_rad) / (1.0 - reference.curvature_1_m * error.across_m);
        Velocity u = controlled(error, {0.5, 0.0});
        u.turn_rate_rad_s += reference.curvature_1_m * ahead_m_s;
        T = T * exp_se2(0.002 * Eigen::Vector3d(0.5, 0.0, u.turn_rate_rad_s));
        if (!spline.closed() && way_m > spline.length_m() - 0.1) break;
      }
    }
  }
}

TEST(PathFollowing, ConvergesFromOffsetsAndArrives) {
  for (const Path& path : {straight(), winding()}) {
    Random random(2);
    for (int n = 0; n < 30; ++n) {
      Drive d =
          drive(path, SplinePath(path).at(0.0).pose() *
                          Pose2{{random.uniform(-0.2, 0.2), random.uniform(-0.6, 0.6)}, random.uniform(-kPi, kPi)});
      d.run(80.0);
      ASSERT_EQ(d.results.back().state, State::kArrived);
      EXPECT_EQ(d.results.back().command.speed_m_s, 0.0);
      const Eigen::Vector2d goal = path.way_points.back().p_world_m;
      EXPECT_LT((d.T.translation_m - goal).norm(), 0.04);
      for (const PathFollowingResult& result : d.results) {
        if (result.way_m < 5.0) continue;
        EXPECT_LT(std::abs(result.error.across_m), 0.03) << result.way_m;
      }
    }
  }
}

TEST(PathFollowing, KeepsToTheVehiclesLimits) {
  const VehicleParams vehicle;
  const PathFollowingParams params;
  Random random(4);
  for (int n = 0; n < 20; ++n) {
    Drive d = drive(winding(), {{random.uniform(-0.5, 0.5), random.uniform(-0.6, 0.6)}, random.uniform(-kPi, kPi)});
    for (int i = 0; i < 2000; ++i) d.step({random.uniform() < 0.02 ? 0.0 : random.uniform(0.0, 0.8), true});
    Velocity before;
    for (const PathFollowingResult& result : d.results) {
      const Velocity& u = result.command;
      EXPECT_GE(u.speed_m_s, 0.0);
      EXPECT_LE(u.speed_m_s, vehicle.max_speed_m_s + 1e-12);
      EXPECT_LE(std::abs(u.turn_rate_rad_s), vehicle.max_turn_rate_rad_s + 1e-12);
      EXPECT_LE(u.speed_m_s - before.speed_m_s, 0.04 * vehicle.acceleration_m_s2 + 1e-12);
      EXPECT_GE(u.speed_m_s - before.speed_m_s, -0.04 * vehicle.braking_m_s2 - 1e-12);
      EXPECT_LE(std::abs(u.turn_rate_rad_s - before.turn_rate_rad_s), 0.04 * vehicle.turn_acceleration_rad_s2 + 1e-12);
      before = u;
    }
  }
}

TEST(PathFollowing, SlowsDownInBends) {
  PathFollowingParams params;
  params.lateral_acceleration_m_s2 = 0.1;
  Drive d = drive(winding(), {{0.0, 0.0}, 0.1}, params);
  d.run(80.0);
  ASSERT_EQ(d.results.back().state, State::kArrived);
  const SplinePath spline(winding());
  double slowest_m_s = 1.0;
  for (const PathFollowingResult& result : d.results) {
    const double bend_1_m = std::abs(spline.at(result.way_m).curvature_1_m);
    const double v = result.command.speed_m_s;
    EXPECT_LE(v * v * bend_1_m, 0.1 * 1.1);
    if (result.way_m > 2.0 && result.way_m < 6.0) slowest_m_s = std::min(slowest_m_s, v);
  }
  EXPECT_LT(slowest_m_s, 0.45);
}

TEST(PathFollowing, ObeysTheSpeedsOfTheFile) {
  Path path = straight();
  path.way_points.insert(path.way_points.begin() + 1, {{4.0, 0.0}, 0.2});
  path.way_points.insert(path.way_points.begin() + 2, {{8.0, 0.0}, 0.4});
  PathFollowingParams params;
  params.transits = 2;
  Drive d = drive(path, {}, params);
  d.run(200.0);
  ASSERT_EQ(d.results.back().state, State::kArrived);
  double there_m_s = 0.0, back_m_s = 0.0;
  for (const PathFollowingResult& result : d.results) {
    const double x_m = result.there ? result.way_m : 12.0 - result.way_m;
    if (x_m > 4.05 && x_m < 7.95) {
      EXPECT_LE(result.command.speed_m_s, 0.2 + 1e-6);
    } else if (x_m > 8.05) {
      EXPECT_LE(result.command.speed_m_s, 0.4 + 1e-6);
    } else {
      (result.there ? there_m_s : back_m_s) = std::max(result.there ? there_m_s : back_m_s, result.command.speed_m_s);
    }
  }
  EXPECT_NEAR(there_m_s, 0.5, 1e-6);
  EXPECT_NEAR(back_m_s, 0.5, 1e-6);
}

TEST(PathFollowing, BrakesToWhatIsAllowed) {
  const VehicleParams vehicle;
  Drive d = drive(straight(), {});
  d.run(6.0);
  EXPECT_NEAR(d.results.back().command.speed_m_s, vehicle.max_speed_m_s, 1e-9);
  const double x_m = d.T.translation_m.x(), v = vehicle.max_speed_m_s;
  while (d.results.back().command.speed_m_s > 0.0) d.step({0.0, false});
  EXPECT_LE(d.T.translation_m.x() - x_m, v * v / (2.0 * vehicle.braking_m_s2) + 0.04 * v);
  for (int i = 0; i < 50; ++i) EXPECT_EQ(d.step({0.0, false}).command.speed_m_s, 0.0);
  d.run(6.0);  // it goes on
  EXPECT_NEAR(d.results.back().command.speed_m_s, v, 1e-9);
  for (int i = 0; i < 100; ++i) d.step({0.1, true});
  EXPECT_NEAR(d.results.back().command.speed_m_s, 0.1, 1e-9);
}

TEST(PathFollowing, BrakesWithoutAPoseAndGoesOnLater) {
  Drive d = drive(straight(), {});
  d.run(6.0);
  const double way_m = d.results.back().way_m;
  for (int i = 0; i < 20; ++i) d.following.brake(d.stamp_ns += kPeriod_ns);
  EXPECT_EQ(d.following.brake(d.stamp_ns += kPeriod_ns).command.speed_m_s, 0.0);
  d.run(60.0);
  EXPECT_EQ(d.results.back().state, State::kArrived);
  EXPECT_GT(d.results.back().way_m, way_m);
}

TEST(PathFollowing, DoesNotTurnWhereItMayNot) {
  Drive d = drive(straight(), {{0.0, 0.0}, 3.0});
  for (int i = 0; i < 100; ++i) {
    const PathFollowingResult& result = d.step({10.0, false});
    EXPECT_EQ(result.state, State::kTurning);
    EXPECT_EQ(result.command.speed_m_s, 0.0);
    EXPECT_EQ(result.command.turn_rate_rad_s, 0.0);
  }
  d.run(60.0);
  EXPECT_EQ(d.results.back().state, State::kArrived);
}

TEST(PathFollowing, GoesThereAndBack) {
  PathFollowingParams params;
  params.transits = 3;
  Drive d = drive(winding(), {}, params);
  d.run(120.0);
  ASSERT_EQ(d.results.back().state, State::kArrived);
  EXPECT_EQ(d.results.back().transit, 2);
  EXPECT_LT((d.T.translation_m - winding().way_points.back().p_world_m).norm(), 0.04);
  for (const PathFollowingResult& result : d.results) EXPECT_EQ(result.there, result.transit % 2 == 0);
  // The next start goes back from where it is.
  d.following.start();
  d.run(10.0);
  EXPECT_FALSE(d.results.back().there);
}

TEST(PathFollowing, DrivesRoundsOfAClosedPath) {
  PathFollowingParams params;
  params.transits = 2;
  Drive d = drive(ring(), {{1.8, 0.3}, 1.4}, params);
  d.run(120.0);
  ASSERT_EQ(d.results.back().state, State::kArrived);
  EXPECT_EQ(d.results.back().transit, 1);
  EXPECT_LT((d.T.translation_m - Eigen::Vector2d(2.0, 0.0)).norm(), 0.05);
  params.transits = 0;
  Drive endless = drive(ring(), {{1.8, 0.3}, 1.4}, params);
  endless.run(120.0);
  EXPECT_GE(endless.results.back().transit, 3);
  EXPECT_EQ(endless.results.back().state, State::kDriving);
}

TEST(PathFollowing, StandsUntilStartedAndWhereItIsFarFromThePath) {
  Drive d{PathFollowing(straight(), {}, {}), {}};
  d.run(1.0);
  EXPECT_EQ(d.results.back().state, State::kStopped);
  EXPECT_EQ(d.T.translation_m.norm(), 0.0);
  d.following.start();
  d.T.translation_m.y() = 1.5;
  d.run(1.0);
  EXPECT_EQ(d.results.back().state, State::kOffPath);
  EXPECT_EQ(d.results.back().command.speed_m_s, 0.0);
}

TEST(PathFollowing, MovesWithTheWorld) {
  const Pose2 T{{5.0, -3.0}, 1.9};
  Path path = winding();
  Drive a = drive(path, {{0.1, 0.3}, -0.4});
  for (WayPoint& point : path.way_points) point.p_world_m = T * point.p_world_m;
  Drive b = drive(path, T * Pose2{{0.1, 0.3}, -0.4});
  a.run(30.0);
  b.run(30.0);
  for (std::size_t i = 0; i < a.results.size(); ++i) {
    EXPECT_EQ(a.results[i].state, b.results[i].state);
    EXPECT_NEAR(a.results[i].command.speed_m_s, b.results[i].command.speed_m_s, 1e-6);
    EXPECT_NEAR(a.results[i].command.turn_rate_rad_s, b.results[i].command.turn_rate_rad_s, 1e-6);
  }
}

TEST(PathFollowing, RefusalsNameFieldAndBound) {
  EXPECT_TRUE(names(refusal_of([] {
                      PathFollowingParams params;
                      params.turn_to_rad = 0.9;
                      PathFollowing(straight(), {}, params);
                    }),
                    {"path.turn_to_rad", "path.turn_from_rad"}));
}

// At every occasion for some seconds, from the start and from the last command to drive on; then twice a second.
TEST(StandingCommands, AreOftenFirstAndThenNowAndThen) {
  StandingCommands commands;
  const auto count = [&](double from_s, double to_s) {
    int due = 0;
    for (int k = 0; k * 0.02 < to_s - from_s; ++k) due += commands.are_due(from_s + k * 0.02) ? 1 : 0;
    return due;
  };
  EXPECT_EQ(count(0.0, 2.99), 150);
  EXPECT_NEAR(count(10.0, 110.0), 200, 10);
  commands.drives(200.0);
  EXPECT_EQ(count(200.02, 202.99), 149);
  EXPECT_NEAR(count(300.0, 400.0), 200, 10);
}

TEST(PathFollowing, GoesOnFromStandingWhereItWasToldToHalt) {
  PathFollowing following({false, {{{0.0, 0.0}, {}}, {{10.0, 0.0}, {}}}}, {}, {});
  following.start();
  std::int64_t stamp_ns = 1'000'000'000;
  const auto speed_m_s = [&] {
    stamp_ns += 20'000'000;
    return following.update(stamp_ns, {{1.0, 0.0}, 0.0}, {1.0, true}).command.speed_m_s;
  };
  for (int i = 0; i < 200; ++i) speed_m_s();
  EXPECT_NEAR(speed_m_s(), VehicleParams().max_speed_m_s, 1e-9);
  following.halt();
  EXPECT_LE(speed_m_s(), 0.02 * VehicleParams().acceleration_m_s2 + 1e-9);
}

}  // namespace
}  // namespace situation_awareness::path_following_test

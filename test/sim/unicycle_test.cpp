// SPDX-License-Identifier: BSD-3-Clause
#include "situation_awareness/sim/unicycle.hpp"

#include <algorithm>
#include <cmath>
#include <limits>
#include <stdexcept>

#include <gtest/gtest.h>

#include "support/refusal.hpp"

namespace situation_awareness::unicycle_test {
namespace {

/// Commands at 20 Hz until then.
void drive(Unicycle& vehicle, double speed_m_s, double yaw_rate_rad_s, double until_s) {
  while (vehicle.time_s() < until_s - 1e-9) {
    vehicle.command(speed_m_s, yaw_rate_rad_s);
    vehicle.advance(std::min(until_s, vehicle.time_s() + 0.05));
  }
}

TEST(Unicycle, DrivesACircle) {
  Unicycle vehicle({}, {{1.0, 2.0}, 0.3});
  drive(vehicle, 0.5, 0.8, 3.0);  // the speeds are reached
  EXPECT_DOUBLE_EQ(vehicle.state().speed_m_s, 0.5);
  EXPECT_DOUBLE_EQ(vehicle.state().yaw_rate_rad_s, 0.8);
  const Pose2 start = vehicle.state().T_world_robot;
  drive(vehicle, 0.5, 0.8, 7.9);
  const double t = vehicle.time_s() - 3.0, r = 0.5 / 0.8;
  const Pose2 arc{{r * std::sin(0.8 * t), r * (1.0 - std::cos(0.8 * t))}, 0.8 * t};
  const Pose2 expected = start * arc;
  EXPECT_NEAR((vehicle.state().T_world_robot.translation_m - expected.translation_m).norm(), 0.0, 1e-9);
  EXPECT_NEAR(vehicle.state().T_world_robot.yaw_rad, expected.yaw_rad, 1e-9);
}

TEST(Unicycle, ItsMotionIsTheSameInAnyFrame) {
  const Pose2 T{{-3.0, 1.5}, 2.1};
  Unicycle a({}, {}), b({}, T);
  for (int i = 1; i <= 50; ++i) {
    drive(a, 0.4 * std::sin(0.3 * i), std::cos(0.2 * i), 0.1 * i);
    drive(b, 0.4 * std::sin(0.3 * i), std::cos(0.2 * i), 0.1 * i);
    const Pose2 expected = T * a.state().T_world_robot;
    ASSERT_NEAR((b.state().T_world_robot.translation_m - expected.translation_m).norm(), 0.0, 1e-9);
    ASSERT_NEAR(b.state().T_world_robot.yaw_rad, expected.yaw_rad, 1e-9);
  }
}

TEST(Unicycle, SpeedsUpAndBrakesWithinItsLimits) {
  UnicycleParams params;
  params.max_speed_m_s = 0.8;
  Unicycle vehicle(params, {});
  double last_m_s = 0.0;
  for (int i = 1; i <= 4000; ++i) {
    vehicle.command(i <= 2500 ? 5.0 : 0.0, 0.0);
    vehicle.advance(1e-3 * i);
    const double now_m_s = vehicle.state().speed_m_s, change_m_s2 = (now_m_s - last_m_s) / 1e-3;
    ASSERT_LE(change_m_s2, params.acceleration_m_s2 + 1e-9);
    ASSERT_GE(change_m_s2, -params.braking_m_s2 - 1e-9);
    ASSERT_LE(now_m_s, params.max_speed_m_s);
    ASSERT_GE(now_m_s, 0.0);
    last_m_s = now_m_s;
  }
  EXPECT_EQ(vehicle.state().speed_m_s, 0.0);
  // v^2 / (2 b) at the greatest braking; below v = b lag, v decays with the lag, which takes it lag v further instead
  // of v^2 / (2 b).
  const double v = params.max_speed_m_s, b = params.braking_m_s2, slow = b * params.lag_s;
  const double braking_m = (v * v - slow * slow) / (2.0 * b) + params.lag_s * slow;
  EXPECT_NEAR(vehicle.state().T_world_robot.translation_m.x() - vehicle.at(2.5).T_world_robot.translation_m.x(),
              braking_m, 1e-3);
}

TEST(Unicycle, FollowsWithItsLag) {
  UnicycleParams params;
  params.acceleration_m_s2 = 50.0;
  params.lag_s = 0.2;
  Unicycle vehicle(params, {});
  drive(vehicle, 1.0, 0.0, 0.2);
  EXPECT_NEAR(vehicle.state().speed_m_s, 1.0 - std::exp(-1.0), 2e-3);
}

TEST(Unicycle, StopsWithoutCommands) {
  Unicycle vehicle({}, {});
  drive(vehicle, 0.4, 0.5, 2.0);
  vehicle.advance(2.0 + vehicle.params().command_timeout_s - 0.06);
  EXPECT_DOUBLE_EQ(vehicle.state().speed_m_s, 0.4);
  vehicle.advance(5.0);
  EXPECT_EQ(vehicle.state().speed_m_s, 0.0);
  EXPECT_EQ(vehicle.state().yaw_rate_rad_s, 0.0);
}

TEST(Unicycle, WhatIsNotFiniteIsAStop) {
  for (const double bad : {std::numeric_limits<double>::quiet_NaN(), std::numeric_limits<double>::infinity()}) {
    Unicycle vehicle({}, {});
    drive(vehicle, 0.4, 0.5, 2.0);
    drive(vehicle, bad, 0.0, 2.9);
    EXPECT_EQ(vehicle.state().speed_m_s, 0.0);
    EXPECT_EQ(vehicle.state().yaw_rate_rad_s, 0.0);
  }
}

TEST(Unicycle, ItsPastIsKnownAndContinuous) {
  Unicycle vehicle({}, {{0.5, 0.0}, 1.0});
  EXPECT_EQ(vehicle.at(-3.0).T_world_robot.translation_m.x(), 0.5);
  drive(vehicle, 0.6, 1.0, 2.0);
  Pose2 last = vehicle.at(0.0).T_world_robot;
  for (int i = 1; i <= 20000; ++i) {
    const UnicycleState state = vehicle.at(1e-4 * i);
    ASSERT_LE((state.T_world_robot.translation_m - last.translation_m).norm(), 1.001e-4 * 0.6);
    ASSERT_NEAR(state.T_world_robot.yaw_rad, last.yaw_rad, 1.001e-4);
    last = state.T_world_robot;
  }
  EXPECT_THROW(vehicle.at(2.01), std::out_of_range);
  vehicle.advance(30.0);
  EXPECT_NO_THROW(vehicle.at(26.0));
  EXPECT_THROW(vehicle.at(24.0), std::out_of_range);
}

TEST(Unicycle, NamesParametersOutOfBounds) {
  UnicycleParams params;
  params.braking_m_s2 = 0.0;
  EXPECT_TRUE(names(refusal_of([&] { Unicycle(params, {}); }), {"unicycle.braking_m_s2", "0", "0.01"}));
}

}  // namespace
}  // namespace situation_awareness::unicycle_test

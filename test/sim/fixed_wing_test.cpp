// SPDX-License-Identifier: BSD-3-Clause
#include "situation_awareness/sim/fixed_wing.hpp"

#include <algorithm>
#include <cmath>
#include <limits>
#include <stdexcept>

#include <gtest/gtest.h>

#include "situation_awareness/geometry/angles.hpp"
#include "support/refusal.hpp"

namespace situation_awareness::fixed_wing_test {
namespace {

constexpr double kHeight_m = 15.0;

/// Commands at 20 Hz until then.
void fly(FixedWing& aircraft, double turn_rate_rad_s, double until_s) {
  while (aircraft.time_s() < until_s - 1e-9) {
    aircraft.command(turn_rate_rad_s);
    aircraft.advance(std::min(until_s, aircraft.time_s() + 0.05));
  }
}

double roll_of(const RobotState& robot) {
  const Eigen::Matrix3d R = robot.T_world_robot.linear();
  return std::atan2(R(2, 1), R(2, 2));
}

TEST(FixedWing, FliesACircleOfItsSpeedOverItsTurnRate) {
  FixedWing aircraft({}, {{1.0, 2.0}, 0.3}, kHeight_m);
  fly(aircraft, 0.5, 8.0);  // the lag is over
  const Pose2 start = aircraft.state().T_world_robot;
  double t_s = 0.0;
  for (const double step_s : {0.7, 2.0, 5.0}) {
    t_s += step_s;
    fly(aircraft, 0.5, 8.0 + t_s);
    const double r_m = 5.0 / 0.5;
    const Pose2 expected = start * Pose2{{r_m * std::sin(0.5 * t_s), r_m * (1.0 - std::cos(0.5 * t_s))}, 0.5 * t_s};
    EXPECT_NEAR((aircraft.state().T_world_robot.translation_m - expected.translation_m).norm(), 0.0, 1e-7);
    EXPECT_NEAR(aircraft.state().T_world_robot.yaw_rad, expected.yaw_rad, 1e-8);
  }
}

TEST(FixedWing, IsCarriedByTheWind) {
  FixedWingParams windy;
  windy.wind_east_m_s = 1.5;
  windy.wind_north_m_s = -0.8;
  FixedWing in_wind(windy, {}, kHeight_m), in_calm({}, {}, kHeight_m);
  for (int i = 1; i <= 40; ++i) {
    for (FixedWing* aircraft : {&in_wind, &in_calm}) fly(*aircraft, std::sin(0.4 * i), 0.25 * i);
    const Eigen::Vector2d off_m =
        in_wind.state().T_world_robot.translation_m - in_calm.state().T_world_robot.translation_m;
    EXPECT_NEAR((off_m - 0.25 * i * Eigen::Vector2d(1.5, -0.8)).norm(), 0.0, 1e-9);
    EXPECT_EQ(in_wind.state().T_world_robot.yaw_rad, in_calm.state().T_world_robot.yaw_rad);
    const Pose2 course = in_wind.T_world_course();
    EXPECT_EQ(course.translation_m, in_wind.state().T_world_robot.translation_m);
    const Eigen::Vector2d along(std::cos(course.yaw_rad), std::sin(course.yaw_rad));
    const Eigen::Vector2d velocity_m_s = in_wind.velocity_world_m_s();
    EXPECT_NEAR((velocity_m_s.norm() * along - velocity_m_s).norm(), 0.0, 1e-12);
  }
}

TEST(FixedWing, ItsMotionIsTheSameInAnyFrame) {
  const Pose2 T{{-3.0, 1.5}, 2.1};
  FixedWing a({}, {}, kHeight_m), b({}, T, kHeight_m);
  for (int i = 1; i <= 50; ++i) {
    for (FixedWing* aircraft : {&a, &b}) fly(*aircraft, std::cos(0.2 * i), 0.1 * i);
    const Pose2 expected = T * a.state().T_world_robot;
    ASSERT_NEAR((b.state().T_world_robot.translation_m - expected.translation_m).norm(), 0.0, 1e-9);
    ASSERT_NEAR(b.state().T_world_robot.yaw_rad, expected.yaw_rad, 1e-9);
  }
}

TEST(FixedWing, TurnsAndBanksWithinItsLimits) {
  const FixedWingParams params;
  FixedWing aircraft(params, {}, kHeight_m);
  for (const double sign : {1.0, -1.0}) {
    fly(aircraft, 10.0 * sign, aircraft.time_s() + 4.0);
    EXPECT_NEAR(aircraft.state().turn_rate_rad_s, sign * params.airspeed_m_s / params.radius_m, 1e-5);
    const double roll_rad = roll_of(aircraft.at(aircraft.time_s()));
    EXPECT_LT(roll_rad * sign, 0.0) << "a turn to the left has a negative roll";
    EXPECT_LE(std::abs(roll_rad), params.max_bank_rad);
    EXPECT_GT(std::abs(roll_rad), 0.95 * params.max_bank_rad);
  }
  // A gentle turn is coordinated: the specific force has no part sideways.
  fly(aircraft, 0.3, aircraft.time_s() + 8.0);
  EXPECT_NEAR(roll_of(aircraft.at(aircraft.time_s())), -std::atan(params.airspeed_m_s * 0.3 / kGravity_m_s2), 1e-5);
}

// What an IMU measures is made of these.
TEST(FixedWing, VelocitiesAreTheDerivativesOfThePose) {
  FixedWingParams params;
  params.wind_east_m_s = 1.0;
  params.gust_rad = 0.02;
  FixedWing aircraft(params, {}, kHeight_m);
  for (int i = 1; i <= 30; ++i) fly(aircraft, 0.8 * std::sin(0.9 * i), 0.15 * i);
  constexpr double kHalf_s = 1e-3;
  for (double t_s = 0.5; t_s < 4.4; t_s += 0.0137) {
    const double since_command_s = std::abs(std::remainder(t_s, 0.05));
    if (since_command_s < 2.0 * kHalf_s) continue;  // where the roll rate jumps
    const RobotState before = aircraft.at(t_s - kHalf_s), robot = aircraft.at(t_s), after = aircraft.at(t_s + kHalf_s);
    const Eigen::Vector3d velocity =
        (after.T_world_robot.translation() - before.T_world_robot.translation()) / (2.0 * kHalf_s);
    EXPECT_NEAR((robot.velocity_world_m_s - velocity).norm(), 0.0, 1e-4);
    const Eigen::AngleAxisd turn(before.T_world_robot.linear().transpose() * after.T_world_robot.linear());
    const Eigen::Vector3d rate = turn.angle() / (2.0 * kHalf_s) * turn.axis();
    EXPECT_NEAR((robot.angular_velocity_robot_rad_s - rate).norm(), 0.0, 0.01) << t_s;
    EXPECT_EQ(robot.T_world_robot.translation().z(), kHeight_m);
  }
}

TEST(FixedWing, FliesStraightOnWithoutCommands) {
  FixedWing aircraft({}, {}, kHeight_m);
  EXPECT_NEAR(aircraft.at(-2.0).T_world_robot.translation().x(), -10.0, 1e-9) << "it came from there";
  fly(aircraft, 0.5, 3.0);
  aircraft.advance(12.0);
  EXPECT_NEAR(aircraft.state().turn_rate_rad_s, 0.0, 1e-6);
  fly(aircraft, 0.5, 15.0);
  aircraft.command(std::numeric_limits<double>::quiet_NaN());
  aircraft.advance(15.9);
  EXPECT_LT(aircraft.state().turn_rate_rad_s, 0.05);
  EXPECT_THROW(aircraft.at(16.5), std::out_of_range);
  EXPECT_THROW(aircraft.at(2.0), std::out_of_range);
}

TEST(FixedWing, RefusesParamsOutOfBounds) {
  FixedWingParams params;
  params.radius_m = 0.0;
  EXPECT_TRUE(names(refusal_of([&] { FixedWing(params, {}, kHeight_m); }), {"fixed_wing.radius_m"}));
}

}  // namespace
}  // namespace situation_awareness::fixed_wing_test

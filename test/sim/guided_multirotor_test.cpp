// SPDX-License-Identifier: BSD-3-Clause
#include "situation_awareness/sim/guided_multirotor.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <stdexcept>
#include <vector>

#include "situation_awareness/sim/lanes_flight.hpp"

namespace situation_awareness::guided_multirotor_test {
namespace {

double yaw_of(const RobotState& state) {
  return std::atan2(state.T_world_robot.linear()(1, 0), state.T_world_robot.linear()(0, 0));
}

TEST(GuidedMultirotor, HoversUntilItGetsAGoal) {
  GuidedMultirotor robot({}, {1.0, 2.0, 30.0}, 0.5);
  robot.advance(3.0);
  for (const double time_s : {-0.5, 0.0, 1.0, 3.0}) {
    const RobotState state = robot.at(time_s);
    EXPECT_TRUE(state.T_world_robot.translation().isApprox(Eigen::Vector3d(1.0, 2.0, 30.0), 1e-12)) << time_s;
    EXPECT_NEAR(yaw_of(state), 0.5, 1e-12);
    EXPECT_NEAR(state.velocity_world_m_s.norm(), 0.0, 1e-12);
  }
}

TEST(GuidedMultirotor, ArrivesAndStaysWithinItsLimits) {
  const GuidedMultirotorParams params;
  GuidedMultirotor robot(params, {0.0, 0.0, 30.0}, 3.0);
  const Eigen::Vector3d goal_m(60.0, -25.0, 22.0);
  robot.go_to(goal_m, -3.0);
  double most_m_s = 0.0, past_m = 0.0;
  for (double time_s = 0.1; time_s < 40.0; time_s += 0.1) {
    robot.advance(time_s);
    const RobotState state = robot.at(robot.time_s());
    most_m_s = std::max(most_m_s, state.velocity_world_m_s.norm());
    past_m = std::max(past_m, (state.T_world_robot.translation() - goal_m).dot(goal_m.normalized()));
    EXPECT_GT(std::abs(yaw_of(state)), 2.9) << "the shorter way";
  }
  EXPECT_LT(most_m_s, 1.1 * params.max_speed_m_s);
  EXPECT_GT(most_m_s, 0.8 * params.max_speed_m_s);
  EXPECT_LT(past_m, 1.0);
  const RobotState end = robot.at(robot.time_s());
  EXPECT_LT((end.T_world_robot.translation() - goal_m).norm(), 0.05);
  EXPECT_NEAR(yaw_of(end), -3.0, 0.01);
}

TEST(GuidedMultirotor, ItsVelocityIsTheDerivativeOfItsPlaceAndItsTurnRateThatOfItsAttitude) {
  GuidedMultirotor robot({}, {0.0, 0.0, 30.0}, 0.0);
  robot.go_to({30.0, 20.0, 35.0}, 2.0);
  robot.advance(4.0);
  constexpr double kStep_s = 1e-3;
  for (const double time_s : {0.7, 1.9, 3.3}) {
    const RobotState before = robot.at(time_s - kStep_s), now = robot.at(time_s), after = robot.at(time_s + kStep_s);
    const Eigen::Vector3d velocity_m_s =
        (after.T_world_robot.translation() - before.T_world_robot.translation()) / (2 * kStep_s);
    EXPECT_LT((velocity_m_s - now.velocity_world_m_s).norm(), 0.01);
    const Eigen::AngleAxisd turn(
        Eigen::Matrix3d(before.T_world_robot.linear().transpose() * after.T_world_robot.linear()));
    EXPECT_LT((turn.angle() * turn.axis() / (2 * kStep_s) - now.angular_velocity_robot_rad_s).norm(), 0.02);
  }
}

TEST(GuidedMultirotor, IgnoresGoalsThatAreNotFinite) {
  GuidedMultirotor robot({}, {0.0, 0.0, 30.0}, 0.0);
  robot.go_to({std::numeric_limits<double>::quiet_NaN(), 0.0, 0.0}, 0.0);
  robot.go_to({0.0, 0.0, 0.0}, std::numeric_limits<double>::infinity());
  robot.advance(1.0);
  EXPECT_EQ(robot.at(1.0).T_world_robot.translation().z(), 30.0);
  GuidedMultirotorParams params;
  params.max_speed_m_s = 0.0;
  EXPECT_THROW(GuidedMultirotor(params, Eigen::Vector3d::Zero(), 0.0), std::invalid_argument);
}

TEST(LanesFlight, PassesAllOfTheRegionAtItsHeightAndComesBack) {
  constexpr double kHalf_m = 40.0, kLane_m = 20.0;
  const Eigen::Vector3d begin_m(-50.0, -45.0, 30.0);
  GuidedMultirotor robot({}, begin_m, 0.0);
  LanesFlight flight(robot, kHalf_m, kLane_m);
  std::vector<Eigen::Vector3d> flown_m;
  while (!flight.done() && robot.time_s() < 200.0) {
    flight.steer();
    robot.advance(robot.time_s() + 0.2);
    flown_m.push_back(robot.at(robot.time_s()).T_world_robot.translation());
  }
  EXPECT_TRUE(flight.done());
  EXPECT_LT((flown_m.back() - begin_m).norm(), 6.0);
  for (double x = -kHalf_m; x <= kHalf_m; x += 10.0) {
    for (double y = -kHalf_m; y <= kHalf_m; y += 10.0) {
      double off_m = std::numeric_limits<double>::infinity();
      for (const Eigen::Vector3d& p_m : flown_m)
        off_m = std::min(off_m, (p_m.head<2>() - Eigen::Vector2d(x, y)).norm());
      EXPECT_LT(off_m, 0.5 * kLane_m + 2.0) << x << ", " << y;
    }
  }
  for (const Eigen::Vector3d& p_m : flown_m) EXPECT_NEAR(p_m.z(), begin_m.z(), 1e-6);
}

}  // namespace
}  // namespace situation_awareness::guided_multirotor_test

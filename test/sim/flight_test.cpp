// SPDX-License-Identifier: BSD-3-Clause
// The robot with motors.
#include <algorithm>
#include <cmath>
#include <string>
#include <vector>

#include <gtest/gtest.h>
#include <Eigen/Geometry>

#include "sim/world_file.hpp"
#include "situation_awareness/geometry/angles.hpp"
#include "situation_awareness/sim/flight_controller.hpp"
#include "situation_awareness/sim/world.hpp"

namespace situation_awareness::flight_test {
namespace {

const std::string kExactRobot = R"(<body name="robot" mocap="true" pos="0 0 1.3"> <site name="lidar"/> </body>)";

std::string path_text(const std::string& path) { return "<text name=\"robot\" data=\"" + path + "\"/>"; }

std::string with_drag(const std::string& path) {
  return path_text(path) + "<numeric name=\"robot_drag\" data=\"0.3\"/>";
}

World flown(const std::string& custom, const std::string& quadrotor = kQuadrotor) {
  return World(WorldFile(world_text("", custom, quadrotor)).path());
}

World exact(const std::string& custom) { return World(WorldFile(world_text(kExactRobot, custom)).path()); }

/// The path of the demo's robot.
std::string demo_path() {
  const std::string text = text_of_file(kWorlds + "demo.xml");
  const std::string begin = "<text name=\"robot\" data=\"";
  const std::size_t from = text.find(begin) + begin.size();
  return text.substr(from, text.find('"', from) - from);
}

/// A closed path with a corner at 3 m/s that needs 8 m/s^2.
const std::string kBrisk =
    "loop speed 2.6 points 0 -2 1.5 0; 3 -2 1.7 1; 4 0.5 2.0 2; 2 2.2 1.6 3; -1 2 1.4 4; "
    "-1.5 0 1.5 5";

double angle_between(const RobotState& a, const RobotState& b) {
  return Eigen::AngleAxisd(a.T_world_robot.linear().transpose() * b.T_world_robot.linear()).angle();
}

double distance_between(const RobotState& a, const RobotState& b) {
  return (a.T_world_robot.translation() - b.T_world_robot.translation()).norm();
}

Airframe airframe() {
  Airframe airframe;
  airframe.mass_kg = 1.6;
  airframe.inertia_kg_m2 = Eigen::Vector3d(0.018, 0.018, 0.030).asDiagonal();
  airframe.wrench_of_motors << 1.0, 1.0, 1.0, 1.0,  //
      0.23, -0.23, -0.23, 0.23,                     //
      -0.23, -0.23, 0.23, 0.23,                     //
      -0.016, 0.016, -0.016, 0.016;
  airframe.max_thrusts_N.setConstant(8.0);
  return airframe;
}

/// Standing at the origin, upright.
RobotState at_rest() { return {}; }

// --- controller -----------------------------------------------------------------------------------------------------

TEST(FlightController, HoversWithItsWeight) {
  const Eigen::Vector4d thrusts = motor_thrusts(airframe(), at_rest(), PathState(), 0.3);
  for (int i = 0; i < 4; ++i) EXPECT_NEAR(thrusts[i], 1.6 * 9.81 / 4.0, 1e-12);
}

TEST(FlightController, PushesBackFromEveryError) {
  const auto wrench = [](const RobotState& robot) {
    return Eigen::Vector4d(airframe().wrench_of_motors * motor_thrusts(airframe(), robot, PathState(), 0.0));
  };
  const double weight_N = 1.6 * 9.81;
  RobotState low = at_rest(), behind = at_rest(), right = at_rest();
  low.T_world_robot.translation().z() = -0.1;
  EXPECT_GT(wrench(low)[0], weight_N + 0.5);
  behind.T_world_robot.translation().x() = -0.1;  // pitch down: about y
  EXPECT_GT(wrench(behind)[2], 0.01);
  right.T_world_robot.translation().y() = -0.1;  // roll to the left: about -x
  EXPECT_LT(wrench(right)[1], -0.01);
  for (int axis = 0; axis < 3; ++axis) {
    RobotState turned = at_rest(), turning = at_rest();
    turned.T_world_robot.linear() = Eigen::AngleAxisd(0.02, Eigen::Vector3d::Unit(axis)).toRotationMatrix();
    turning.angular_velocity_robot_rad_s[axis] = 0.05;
    EXPECT_LT(wrench(turned)[1 + axis], -0.005) << axis;
    EXPECT_LT(wrench(turning)[1 + axis], -0.005) << axis;
  }
}

TEST(FlightController, KeepsWithinTheMotorsLimitsForAnyCommand) {
  for (int i = 0; i < 500; ++i) {
    RobotState robot;
    const Eigen::Vector3d axis = Eigen::Vector3d(std::sin(i), std::cos(2.0 * i), std::sin(3.0 * i + 1.0)).normalized();
    robot.T_world_robot.linear() = Eigen::AngleAxisd(0.05 * i, axis).toRotationMatrix();
    robot.T_world_robot.translation() = 0.1 * i * axis;
    robot.velocity_world_m_s = -0.05 * i * axis;
    robot.angular_velocity_robot_rad_s = Eigen::Vector3d(0.1 * i, -0.07 * i, 0.2 * i);
    const Eigen::Vector4d thrusts = motor_thrusts(airframe(), robot, PathState(), 0.3);
    EXPECT_GE(thrusts.minCoeff(), -1e-12);
    EXPECT_LE(thrusts.maxCoeff(), 8.0 + 1e-12);
  }
}

// --- flight ---------------------------------------------------------------------------------------------------------

TEST(Flight, HoversWithoutDrift) {
  const World world = flown("");
  for (const double t : {0.0, 0.1, 3.3, 40.0}) {
    const RobotState robot = world.robot_at(t);
    EXPECT_LT((robot.T_world_robot.translation() - Eigen::Vector3d(0, 0, 1.3)).norm(), 1e-9);
    EXPECT_LT(robot.velocity_world_m_s.norm(), 1e-9);
    EXPECT_NEAR(robot.T_world_robot(2, 2), 1.0, 1e-12);
  }
}

TEST(Flight, FollowsTheDemosPathInTheAttitudeOfFlatness) {
  const World by_motors = flown(with_drag(demo_path())), by_decree = exact(with_drag(demo_path()));
  double distance_m = 0.0, angle_rad = 0.0, tilt_error = 0.0;
  for (double t = -1.0; t < 60.0; t += 0.013) {
    const RobotState a = by_motors.robot_at(t), b = by_decree.robot_at(t);
    if (t <= 0.0) {
      EXPECT_EQ(distance_between(a, b), 0.0);
    }
    distance_m = std::max(distance_m, distance_between(a, b));
    angle_rad = std::max(angle_rad, angle_between(a, b));
    tilt_error = std::max(tilt_error, (a.T_world_robot.linear().col(2) - b.T_world_robot.linear().col(2)).norm());
  }
  EXPECT_LT(distance_m, 0.005);
  EXPECT_LT(tilt_error, radians(0.5));
  EXPECT_LT(angle_rad, radians(2.5));  // most of it yaw, which its motors turn slowly
  EXPECT_GT(distance_m, 0.0);
}

TEST(Flight, FollowsAFastPath) {
  const World by_motors = flown(with_drag(kBrisk)), by_decree = exact(with_drag(kBrisk));
  double distance_m = 0.0;
  for (double t = 0.0; t < 60.0; t += 0.013) {
    distance_m = std::max(distance_m, distance_between(by_motors.robot_at(t), by_decree.robot_at(t)));
  }
  EXPECT_LT(distance_m, 0.1);
}

TEST(Flight, AcceleratesByThrustGravityAndDragOnly) {
  const World world = flown(with_drag(kBrisk));
  constexpr double kStep_s = 0.004;
  for (double t = 0.2; t < 20.0; t += 25.0 * kStep_s) {
    const RobotState now = world.robot_at(t);
    const Eigen::Vector3d acceleration =
        (world.robot_at(t + kStep_s).velocity_world_m_s - world.robot_at(t - kStep_s).velocity_world_m_s) /
        (2.0 * kStep_s);
    const Eigen::Vector3d thrust = acceleration + Eigen::Vector3d(0, 0, 9.81) + 0.3 * now.velocity_world_m_s;
    const Eigen::Vector3d z = now.T_world_robot.linear().col(2);
    EXPECT_LT(thrust.cross(z).norm(), 0.02) << t;
    EXPECT_GT(thrust.dot(z), 3.0);
    EXPECT_LT(thrust.dot(z), 20.0);
  }
}

TEST(Flight, VelocitiesAreDerivativesOfThePose) {
  const World world = flown(with_drag(kBrisk));
  constexpr double h = 1e-5;
  for (double t = 0.0013; t < 20.0; t += 0.0371) {
    const RobotState now = world.robot_at(t), before = world.robot_at(t - h), after = world.robot_at(t + h);
    const Eigen::Vector3d velocity =
        (after.T_world_robot.translation() - before.T_world_robot.translation()) / (2.0 * h);
    EXPECT_LT((velocity - now.velocity_world_m_s).norm(), 1e-4) << t;
    const Eigen::AngleAxisd turn(before.T_world_robot.linear().transpose() * after.T_world_robot.linear());
    const Eigen::Vector3d w = turn.angle() * turn.axis() / (2.0 * h);
    EXPECT_LT((w - now.angular_velocity_robot_rad_s).norm(), 1e-3) << t;
    EXPECT_TRUE(now.T_world_robot.linear().isUnitary(1e-12));
  }
}

TEST(Flight, IsTheSameBitForBitForAnyOrderOfQueries) {
  const World forwards = flown(with_drag(kBrisk)), backwards = flown(with_drag(kBrisk));
  std::vector<RobotState> states;
  for (int i = 0; i < 90; ++i) states.push_back(forwards.robot_at(0.5 * i + 0.0017));
  for (int i = 89; i >= 0; --i) {
    const RobotState state = backwards.robot_at(0.5 * i + 0.0017);
    const RobotState& before = states[static_cast<std::size_t>(i)];
    ASSERT_TRUE(state.T_world_robot.matrix() == before.T_world_robot.matrix()) << i;
    ASSERT_TRUE(state.velocity_world_m_s == before.velocity_world_m_s) << i;
    ASSERT_TRUE(state.angular_velocity_robot_rad_s == before.angular_velocity_robot_rad_s) << i;
  }
}

TEST(Flight, ConvergesAsStepsBecomeShorter) {
  const auto flown_with = [](const std::string& step) {
    return flown(with_drag(kBrisk), replaced(kQuadrotor, "timestep=\"0.004\"", "timestep=\"" + step + "\""));
  };
  const World fine = flown_with("0.00025"), coarse = flown_with("0.004"), middle = flown_with("0.002");
  double coarse_m = 0.0, middle_m = 0.0;
  for (double t = 0.0; t < 8.0; t += 0.05) {
    coarse_m = std::max(coarse_m, distance_between(coarse.robot_at(t), fine.robot_at(t)));
    middle_m = std::max(middle_m, distance_between(middle.robot_at(t), fine.robot_at(t)));
  }
  // Thrusts are set once per step, so the error is of first order.
  EXPECT_LT(coarse_m, 0.02);
  EXPECT_LT(middle_m, 0.6 * coarse_m);
}

TEST(Flight, TurnsWithTheWorld) {
  const World world = flown(with_drag("circle center 1 0.5 radius 2 rate 1.1 phase 0.3 spin 0.7"));
  const World turned = flown(with_drag("circle center -0.5 1 radius 2 rate 1.1 phase 1.8707963267948966 spin 0.7"),
                             replaced(kQuadrotor, "<body name=\"robot\" pos=\"0 0 1.3\">",
                                      "<body name=\"robot\" pos=\"0 0 1.3\" euler=\"0 0 1.5707963267948966\">"));
  const Eigen::Isometry3d quarter(Eigen::AngleAxisd(0.5 * kPi, Eigen::Vector3d::UnitZ()));
  for (double t = 0.0; t < 20.0; t += 0.37) {
    const Eigen::Isometry3d expected = quarter * world.robot_at(t).T_world_robot;
    EXPECT_TRUE(turned.robot_at(t).T_world_robot.isApprox(expected, 1e-9)) << t;
  }
}

TEST(Flight, ReturnsToItsPathAfterItsMotorsSaturated) {
  // Distant points at equal time steps: a sprint that the motors cannot follow within an easy path.
  const std::string dash =
      "loop speed 1.8 points -3 0; -3 0.6; -3 1.2; -3 1.8; -2.4 2.2; -1.8 2.2; -1.2 2.2; 6 2.2; 6.6 2.2; 7 1.6; 7 1; "
      "6.8 0.4; 6.2 0; 5 0; 4 0; 3 0; 2 0; 1 0; 0 0; -1 0; -2 0; -2.6 0";
  const World by_motors = flown(with_drag(dash)), by_decree = exact(with_drag(dash));
  const auto worst_m = [&](double from_s, double to_s) {
    double worst_m = 0.0;
    for (double t = from_s; t < to_s; t += 0.01) {
      worst_m = std::max(worst_m, distance_between(by_motors.robot_at(t), by_decree.robot_at(t)));
    }
    return worst_m;
  };
  EXPECT_LT(worst_m(0.0, 2.0), 0.05);
  EXPECT_GT(worst_m(3.5, 6.0), 1.0);
  EXPECT_LT(worst_m(9.0, 13.0), 0.05);
}

TEST(Flight, ThrowsWhereThePathIsTooFastForItsMotors) {
  const World world = flown(with_drag("circle center 0 0 radius 20 rate 2"));
  EXPECT_TRUE(names(refusal_of<std::runtime_error>([&] { world.robot_at(30.0); }), {"path"})) << "80 m/s^2";
}

// --- files ----------------------------------------------------------------------------------------------------------

TEST(Flight, RefusesBadRobots) {
  const auto changed = [](const std::string& from, const std::string& to) {
    return world_text("", "", replaced(kQuadrotor, from, to));
  };
  const std::string rear_left = kQuadrotor.substr(kQuadrotor.find("<general name=\"rear_left\""));
  const std::string last_motor = rear_left.substr(0, rear_left.find("/>") + 2);
  EXPECT_EQ(error_of(world_text("", "", kQuadrotor)), "no error");
  expect_error(changed(last_motor, ""), {"robot", "four", "3"});
  expect_error(changed("mass=\"1.6\"", "mass=\"0\""), {"MuJoCo"});
  expect_error(changed("mass=\"1.6\"", "mass=\"3\""), {"robot", "motors"});
  expect_error(changed("<inertial pos=\"0 0 0\"", "<inertial pos=\"0 0 0.1\""), {"robot", "centre of mass"});
  expect_error(changed(last_motor, replaced(last_motor, "gear=\"0 0 1 0 0 0.016\"", "gear=\"0 1 1 0 0 0\"")),
               {"rear_left", "robot", "z"});
  expect_error(changed(last_motor, replaced(last_motor, "gear=\"0 0 1 0 0 0.016\"", "gear=\"0 0 1 0 0 -0.048\"")),
               {"robot", "axes"});
  expect_error(changed(last_motor, replaced(last_motor, "dyntype=\"filter\"", "dyntype=\"integrator\"")),
               {"rear_left", "dyntype", "filter"});
  expect_error(changed(last_motor, replaced(last_motor, "ctrllimited=\"true\"", "ctrllimited=\"false\"")),
               {"rear_left", "ctrllimited"});
  expect_error(changed("timestep=\"0.004\"", "timestep=\"0.02\""), {"timestep", "0.005"});
  expect_error(changed("<option ", "<option gravity=\"0 0 -1.6\" "), {"gravity", "-9.81"});
  expect_error(changed("<freejoint/>", "<joint type=\"hinge\"/>"), {"robot", "mocap"});
  expect_error(
      world_text("<body name=\"b\"><joint name=\"hinge\"/><geom group=\"2\" size=\"1\"/></body>", "", kQuadrotor),
      {"hinge"});
  const std::string motor = "<actuator><motor name=\"idle\" site=\"lidar\"/></actuator>";
  expect_error(world_text(kExactRobot, "", motor), {"idle"});
}

}  // namespace
}  // namespace situation_awareness::flight_test

// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <Eigen/Core>

#include "situation_awareness/sim/multirotor.hpp"
#include "situation_awareness/sim/path.hpp"

namespace situation_awareness {

/// The controller's model of a multirotor with four motors. The robot's frame has its origin in the centre of mass, and
/// the motors push along its z axis.
struct Airframe {
  double mass_kg = 0.0;
  Eigen::Matrix3d inertia_kg_m2 = Eigen::Matrix3d::Zero();  ///< in the robot's axes
  /// Per newton of each motor, one column each: the force along z in N, and the torques about x, y and z in N m.
  Eigen::Matrix4d wrench_of_motors = Eigen::Matrix4d::Zero();
  Eigen::Vector4d min_thrusts_N = Eigen::Vector4d::Zero();
  Eigen::Vector4d max_thrusts_N = Eigen::Vector4d::Zero();
};

/// Thrust of each motor, in N and within its limits, to track the given state of the path.
///
/// The path's acceleration, gravity and the drag at the path's velocity are fed forward; errors of position and
/// velocity add an acceleration of limited size. The sum is the thrust vector: with the path's yaw it gives the desired
/// attitude (multirotor_state), which is tracked on SO(3) (Lee, Leok, McClamroch: Geometric tracking control of a
/// quadrotor UAV on SE(3), CDC 2010). Where motors saturate, yaw is reduced first, then tilt, and thrust keeps a margin
/// to the limits.
Eigen::Vector4d motor_thrusts(const Airframe& airframe, const RobotState& robot, const PathState& path,
                              double drag_1_s);

}  // namespace situation_awareness

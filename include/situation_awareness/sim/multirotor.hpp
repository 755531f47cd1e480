// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <Eigen/Geometry>

#include "situation_awareness/sim/path.hpp"

namespace situation_awareness {

constexpr double kGravity_m_s2 = 9.81;

/// State of the simulated robot.
struct RobotState {
  Eigen::Isometry3d T_world_robot = Eigen::Isometry3d::Identity();
  Eigen::Vector3d velocity_world_m_s = Eigen::Vector3d::Zero();
  Eigen::Vector3d angular_velocity_robot_rad_s = Eigen::Vector3d::Zero();
};

/// State of a multirotor that follows a path exactly, by differential flatness: thrust acts along the robot's z axis,
/// so with linear drag the robot tilts until z points along a + g e_z + drag v. Yaw is that of the usual yaw, pitch,
/// roll angles: the heading of the robot's x axis. `drag_1_s` is the drag's force per mass and velocity.
RobotState multirotor_state(const PathState& path, double drag_1_s);

}  // namespace situation_awareness

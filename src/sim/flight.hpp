// SPDX-License-Identifier: BSD-3-Clause
// The flight of a robot with motors. Private to sim/, because it includes MuJoCo.
#pragma once

#include <array>
#include <vector>

#include <Eigen/Geometry>

#include "situation_awareness/sim/flight_controller.hpp"
#include "world_model.hpp"

namespace situation_awareness {

/// The robot's flight along its path, integrated by MuJoCo: body `robot` with a free joint and four motors, linear
/// drag, and the controller called once per step. It begins on the path at time 0, in the path's attitude.
///
/// A function of time: times may be queried in any order, with the same result, bit for bit. Later times are integrated
/// on demand; for earlier times the state every few seconds is kept, from which the steps are integrated again. Between
/// steps the pose is a cubic with the steps' velocities at its ends, and velocities are its derivatives.
class Flight {
 public:
  /// `model` must outlive the flight. Throws std::runtime_error naming the error in robot or motors.
  Flight(const mjModel& model, int robot_body, ScriptedPath path, double drag_1_s);

  /// Throws std::runtime_error where the robot has left its path. Before time 0 it is on it.
  RobotState at(double time_s) const;

 private:
  /// The state for the next step.
  struct State {
    Eigen::Vector3d position_m, velocity_m_s;
    Eigen::Quaterniond q_world_robot;
    Eigen::Vector3d angular_velocity_robot_rad_s;
    Eigen::Vector4d thrusts_N;
  };
  /// Some seconds of the flight, as far as they were queried.
  struct Leg {
    long number = -1;
    std::vector<State> steps;  // the last of a complete leg is the first of the next
  };

  State start() const;
  State after(const State& state, long step) const;
  /// The leg's first `count` steps at least.
  const std::vector<State>& steps_of_leg(long number, std::size_t count) const;

  const mjModel& model_;
  DataPtr data_;  // MuJoCo's working memory, without state between calls
  int body_;
  ScriptedPath path_;
  double drag_1_s_;
  double step_s_;
  Airframe airframe_;
  mutable std::vector<State> leg_starts_;
  mutable std::array<Leg, 2> recent_legs_;  // the most recently used first
};

}  // namespace situation_awareness

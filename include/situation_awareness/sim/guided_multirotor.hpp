// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <Eigen/Core>

#include "situation_awareness/common/params.hpp"
#include "situation_awareness/sim/multirotor.hpp"
#include "situation_awareness/sim/path.hpp"
#include "situation_awareness/sim/step_history.hpp"

namespace situation_awareness {

/// A multirotor with an autopilot that takes it to where it is told.
struct GuidedMultirotorParams {
  double max_speed_m_s = 8.0;
  double max_acceleration_m_s2 = 2.5;
  double max_yaw_rate_rad_s = 0.8;
  double position_lag_s = 1.2;
  double velocity_lag_s = 0.5;
  double acceleration_lag_s = 0.2;
  double yaw_lag_s = 0.8;
  double drag_1_s = 0.2;

  template <class Self, class Visit>
  static void fields(Self& self, Visit&& visit) {
    visit("max_speed_m_s", self.max_speed_m_s, Bounds{0.1, 50.0}, "m/s", "greatest speed");
    visit("max_acceleration_m_s2", self.max_acceleration_m_s2, Bounds{0.1, 20.0}, "m/s^2",
          "greatest acceleration, and with which it brakes");
    visit("max_yaw_rate_rad_s", self.max_yaw_rate_rad_s, Bounds{0.01, 10.0}, "rad/s", "greatest rate of yaw");
    visit("position_lag_s", self.position_lag_s, Bounds{0.05, 20.0}, "s", "time constant of the position, near by");
    visit("velocity_lag_s", self.velocity_lag_s, Bounds{0.05, 20.0}, "s", "of the velocity");
    visit("acceleration_lag_s", self.acceleration_lag_s, Bounds{0.02, 5.0}, "s", "of the acceleration, and so of tilt");
    visit("yaw_lag_s", self.yaw_lag_s, Bounds{0.05, 20.0}, "s", "of the yaw");
    visit("drag_1_s", self.drag_1_s, Bounds{0.0, 10.0}, "1/s", "the drag's force per mass and velocity");
  }

  /// Throws std::invalid_argument naming field and bound.
  void validate() const { check_bounds(*this, "multirotor"); }
};

/// The motion of such a multirotor. The velocity that it wants is towards the goal, so fast that it can brake; the
/// acceleration follows with a lag of first order, bounded:
///
///     v_goal = d / |d| min(|d| / T_p, sqrt(2 a_max |d|), v_max),   d = p_goal - p
///     a_goal = (v_goal - v) / T_v, at most a_max,                   a' = (a_goal - a) / T_a
///
/// Its tilt is the one that this acceleration needs (multirotor.hpp); yaw turns the shorter way. The same goals at the
/// same times give the same motion, bit for bit.
class GuidedMultirotor {
 public:
  /// It hovers there. Throws std::invalid_argument for params.
  GuidedMultirotor(const GuidedMultirotorParams& params, const Eigen::Vector3d& p_world_m, double yaw_rad);

  const GuidedMultirotorParams& params() const { return params_; }

  /// Until when the motion is known.
  double time_s() const { return history_.time_s(); }

  /// Holds from `time_s()` on. A goal that is not finite is ignored.
  void go_to(const Eigen::Vector3d& p_world_m, double yaw_rad);

  /// Moves on to the first step that is not before `time_s`.
  void advance(double time_s);

  /// The robot at a time of the last seconds; before time 0 it hovered. Throws std::out_of_range for other times.
  RobotState at(double time_s) const;

 private:
  PathState next(const PathState& state, double step_s) const;

  GuidedMultirotorParams params_;
  Eigen::Vector3d goal_m_;
  double goal_yaw_rad_;
  PathState begin_;
  StepHistory<PathState> history_;
};

}  // namespace situation_awareness

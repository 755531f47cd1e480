// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstdint>

#include <Eigen/Core>

#include "situation_awareness/common/params.hpp"
#include "situation_awareness/geometry/pose2.hpp"
#include "situation_awareness/sim/multirotor.hpp"
#include "situation_awareness/sim/step_history.hpp"

namespace situation_awareness {

/// A vehicle like a small fixed-wing aircraft. Speed, turning radius and bank are those of the splinegon paper's
/// vehicle (docs/math/splinegons.md).
struct FixedWingParams {
  double airspeed_m_s = 5.0;
  double radius_m = 6.0;
  double max_bank_rad = 0.35;
  double nose_up_rad = 0.035;
  double lag_s = 0.3;
  double wind_east_m_s = 0.0;
  double wind_north_m_s = 0.0;
  double gust_rad = 0.0;
  double command_timeout_s = 1.0;

  template <class Self, class Visit>
  static void fields(Self& self, Visit&& visit) {
    visit("airspeed_m_s", self.airspeed_m_s, Bounds{0.1, 100.0}, "m/s", "through the air, constant");
    visit("radius_m", self.radius_m, Bounds{0.1, 1e4}, "m", "of the tightest turn through the air");
    visit("max_bank_rad", self.max_bank_rad, Bounds{0.0, 1.4}, "rad", "greatest bank");
    visit("nose_up_rad", self.nose_up_rad, Bounds{-0.5, 0.5}, "rad", "how much the nose is up");
    visit("lag_s", self.lag_s, Bounds{0.01, 10.0}, "s", "time constant of the turn rate, and so of the bank");
    visit("wind_east_m_s", self.wind_east_m_s, Bounds{-50.0, 50.0}, "m/s", "velocity of the air");
    visit("wind_north_m_s", self.wind_north_m_s, Bounds{-50.0, 50.0}, "m/s", "velocity of the air");
    visit("gust_rad", self.gust_rad, Bounds{0.0, 0.5}, "rad", "greatest error of roll, pitch and yaw by gusts");
    visit("command_timeout_s", self.command_timeout_s, Bounds{0.01, 100.0}, "s",
          "the vehicle flies straight on where no command came for so long");
  }

  /// Throws std::invalid_argument naming field and bound.
  void validate() const { check_bounds(*this, "fixed_wing"); }
};

/// State of the motion, without gusts.
struct FixedWingState {
  Pose2 T_world_robot;  ///< yaw is the heading, without jumps; with wind the course is another
  double turn_rate_rad_s = 0.0;
};

/// The motion of a fixed-wing-like vehicle at constant height and airspeed. Its turn rate w follows the command with a
/// lag of first order, at most airspeed / radius; it flies where it heads, carried by the wind:
///
///     w' = (w_command - w) / lag,    p' = V (cos yaw, sin yaw) + wind.
///
/// It banks as a coordinated turn asks, atan(V w / g), softly limited; a turn to the left has a negative roll (axes
/// ahead, left, up). Gusts add sines of the time to roll, pitch and yaw. The same commands at the same times give the
/// same motion, bit for bit.
class FixedWing {
 public:
  /// Throws std::invalid_argument for params.
  FixedWing(const FixedWingParams& params, const Pose2& T_world_robot, double height_m);

  const FixedWingParams& params() const { return params_; }

  /// Until when the motion is known.
  double time_s() const { return history_.time_s(); }

  /// The state at `time_s()`.
  const FixedWingState& state() const { return history_.latest(); }

  /// Over the ground at `time_s()`.
  Eigen::Vector2d velocity_world_m_s() const { return velocity_of(history_.latest()); }

  /// Where it is and where it moves at `time_s()`: with wind the course over the ground is not the heading.
  Pose2 T_world_course() const;

  /// Left positive; holds from `time_s()` on, until the next command or the timeout. What is not finite is straight on.
  void command(double turn_rate_rad_s);

  /// Moves on to the first step that is not before `time_s`.
  void advance(double time_s);

  /// The robot at a time of the last seconds; before time 0 it came straight on. Throws std::out_of_range for other
  /// times.
  RobotState at(double time_s) const;

 private:
  Eigen::Vector2d velocity_of(const FixedWingState& state) const;
  FixedWingState moved(const FixedWingState& state, double turn_rate_rad_s, double duration_s) const;

  FixedWingParams params_;
  double height_m_;
  Eigen::Vector2d wind_m_s_;
  double command_rad_s_ = 0.0;
  std::int64_t command_step_ = 0;
  StepHistory<FixedWingState> history_;
};

}  // namespace situation_awareness

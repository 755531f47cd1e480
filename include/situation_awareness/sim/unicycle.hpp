// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstdint>

#include "situation_awareness/common/params.hpp"
#include "situation_awareness/geometry/pose2.hpp"
#include "situation_awareness/sim/step_history.hpp"

namespace situation_awareness {

/// A vehicle with two driven wheels. Speeds are those of the data sheet of the Pioneer 3-DX (swing radius 0.26 m); its
/// accelerations are set in its firmware, those here are moderate ones.
struct UnicycleParams {
  double max_speed_m_s = 1.2;
  double max_yaw_rate_rad_s = 5.2;
  double acceleration_m_s2 = 0.5;
  double braking_m_s2 = 1.0;
  double yaw_acceleration_rad_s2 = 4.0;
  double lag_s = 0.1;
  double command_timeout_s = 0.5;

  template <class Self, class Visit>
  static void fields(Self& self, Visit&& visit) {
    visit("max_speed_m_s", self.max_speed_m_s, Bounds{0.01, 10.0}, "m/s", "fastest, ahead and backwards");
    visit("max_yaw_rate_rad_s", self.max_yaw_rate_rad_s, Bounds{0.01, 20.0}, "rad/s", "fastest turn");
    visit("acceleration_m_s2", self.acceleration_m_s2, Bounds{0.01, 50.0}, "m/s^2", "at most, to a higher speed");
    visit("braking_m_s2", self.braking_m_s2, Bounds{0.01, 50.0}, "m/s^2", "at most, to a lower speed");
    visit("yaw_acceleration_rad_s2", self.yaw_acceleration_rad_s2, Bounds{0.01, 100.0}, "rad/s^2",
          "of the yaw rate, at most");
    visit("lag_s", self.lag_s, Bounds{0.002, 10.0}, "s", "time constant of the drives");
    visit("command_timeout_s", self.command_timeout_s, Bounds{0.01, 100.0}, "s",
          "the vehicle stops where no command came for so long");
  }

  /// Throws std::invalid_argument naming field and bound.
  void validate() const { check_bounds(*this, "unicycle"); }
};

/// State of the vehicle in truth.
struct UnicycleState {
  Pose2 T_world_robot;     ///< the middle between the wheels; yaw without jumps
  double speed_m_s = 0.0;  ///< ahead
  double yaw_rate_rad_s = 0.0;
};

/// The motion of a unicycle that is driven by commands. Speed and yaw rate follow the command with a lag of first order
/// within the limits of speed and acceleration,
///
///     v' = clamp((v_command - v) / lag, -a, a),   a = braking towards 0, else acceleration,
///
/// and the pose follows from them without slip. Integrated in steps of 1 ms; between steps v and w are constant. The
/// same commands at the same times give the same motion, bit for bit.
class Unicycle {
 public:
  /// Throws std::invalid_argument for params.
  Unicycle(const UnicycleParams& params, const Pose2& T_world_robot);

  const UnicycleParams& params() const { return params_; }

  /// Until when the motion is known.
  double time_s() const { return history_.time_s(); }

  /// The state at `time_s()`.
  const UnicycleState& state() const { return history_.latest(); }

  /// Holds from `time_s()` on, until the next command or the timeout. What is not finite is a stop.
  void command(double speed_m_s, double yaw_rate_rad_s);

  /// Moves on to the first step that is not before `time_s`.
  void advance(double time_s);

  /// The state at a time of the last `kKept_s`; before time 0 the vehicle stands where it begins. Throws
  /// std::out_of_range for other times.
  UnicycleState at(double time_s) const;

  static constexpr double kStep_s = StepHistory<UnicycleState>::kStep_s;
  static constexpr double kKept_s = StepHistory<UnicycleState>::kKept_s;

 private:
  void step();

  UnicycleParams params_;
  double command_m_s_ = 0.0, command_rad_s_ = 0.0;
  std::int64_t command_step_ = 0;
  StepHistory<UnicycleState> history_;
};

}  // namespace situation_awareness

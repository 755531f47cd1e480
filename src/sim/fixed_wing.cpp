// SPDX-License-Identifier: BSD-3-Clause
#include "situation_awareness/sim/fixed_wing.hpp"

#include <algorithm>
#include <array>
#include <cmath>

#include "situation_awareness/geometry/angles.hpp"

namespace situation_awareness {
namespace {

/// Exponent of the bank's limit: the larger, the sharper.
constexpr int kSoft = 20;

/// Frequencies (Hz) of gusts in roll, pitch and yaw: those of the evaluation's flights lie between 0.2 and 0.9 Hz.
constexpr std::array<std::array<double, 3>, 3> kGusts_Hz = {
    {{0.23, 0.47, 0.83}, {0.29, 0.53, 0.71}, {0.21, 0.41, 0.67}}};

/// An angle and its rate.
struct Angle {
  double rad, rad_s;
};

/// The error by gusts: of each of three sines a third.
Angle gust(std::size_t axis, double most_rad, double time_s) {
  Angle sum{0.0, 0.0};
  for (const double frequency_Hz : kGusts_Hz[axis]) {
    const double w = 2.0 * kPi * frequency_Hz;
    sum.rad += most_rad / 3.0 * std::sin(w * time_s);
    sum.rad_s += most_rad / 3.0 * w * std::cos(w * time_s);
  }
  return sum;
}

/// The bank of a coordinated turn, x / (1 + x^n)^(1/n) of the limit.
Angle bank(const FixedWingParams& params, double turn_rate_rad_s, double turn_acceleration_rad_s2) {
  if (!(params.max_bank_rad > 0.0)) return {0.0, 0.0};
  const double tangent = params.airspeed_m_s * turn_rate_rad_s / kGravity_m_s2;
  const double x = std::atan(tangent) / params.max_bank_rad;
  const double x_s =
      params.airspeed_m_s * turn_acceleration_rad_s2 / kGravity_m_s2 / (1.0 + tangent * tangent) / params.max_bank_rad;
  const double base = 1.0 + std::pow(x, kSoft);
  return {params.max_bank_rad * x * std::pow(base, -1.0 / kSoft),
          params.max_bank_rad * x_s * std::pow(base, -1.0 / kSoft - 1.0)};
}

}  // namespace

FixedWing::FixedWing(const FixedWingParams& params, const Pose2& T_world_robot, double height_m)
    : params_((params.validate(), params)),
      height_m_(height_m),
      wind_m_s_(params.wind_east_m_s, params.wind_north_m_s),
      history_(FixedWingState{T_world_robot, 0.0}) {}

void FixedWing::command(double turn_rate_rad_s) {
  const double most = params_.airspeed_m_s / params_.radius_m;
  command_rad_s_ = std::isfinite(turn_rate_rad_s) ? std::clamp(turn_rate_rad_s, -most, most) : 0.0;
  command_step_ = history_.steps();
}

Eigen::Vector2d FixedWing::velocity_of(const FixedWingState& state) const {
  const double yaw_rad = state.T_world_robot.yaw_rad;
  return params_.airspeed_m_s * Eigen::Vector2d(std::cos(yaw_rad), std::sin(yaw_rad)) + wind_m_s_;
}

Pose2 FixedWing::T_world_course() const {
  const Eigen::Vector2d velocity_m_s = velocity_world_m_s();
  return {state().T_world_robot.translation_m, std::atan2(velocity_m_s.y(), velocity_m_s.x())};
}

/// At a constant turn rate: an arc through the air, by its chord.
FixedWingState FixedWing::moved(const FixedWingState& state, double turn_rate_rad_s, double duration_s) const {
  const double half_turn_rad = 0.5 * turn_rate_rad_s * duration_s;
  const double sinc = std::abs(half_turn_rad) < 1e-6 ? 1.0 : std::sin(half_turn_rad) / half_turn_rad;
  const double chord_m = params_.airspeed_m_s * duration_s * sinc;
  const double direction_rad = state.T_world_robot.yaw_rad + half_turn_rad;
  FixedWingState next;
  next.T_world_robot.translation_m = state.T_world_robot.translation_m +
                                     chord_m * Eigen::Vector2d(std::cos(direction_rad), std::sin(direction_rad)) +
                                     duration_s * wind_m_s_;
  next.T_world_robot.yaw_rad = state.T_world_robot.yaw_rad + 2.0 * half_turn_rad;
  next.turn_rate_rad_s = turn_rate_rad_s;
  return next;
}

void FixedWing::advance(double time_s) {
  constexpr double kStep_s = StepHistory<FixedWingState>::kStep_s;
  const double followed = 1.0 - std::exp(-kStep_s / params_.lag_s);
  for (std::int64_t missing = history_.missing(time_s); missing > 0; --missing) {
    if (static_cast<double>(history_.steps() - command_step_) * kStep_s >= params_.command_timeout_s) {
      command_rad_s_ = 0.0;
    }
    const FixedWingState& before = history_.latest();
    const double turn_rate_rad_s = before.turn_rate_rad_s + followed * (command_rad_s_ - before.turn_rate_rad_s);
    // The trapezoid keeps the heading smooth to the second order.
    FixedWingState next = moved(before, 0.5 * (before.turn_rate_rad_s + turn_rate_rad_s), kStep_s);
    next.turn_rate_rad_s = turn_rate_rad_s;
    history_.push(next);
  }
}

RobotState FixedWing::at(double time_s) const {
  FixedWingState state;
  double turn_acceleration_rad_s2 = 0.0;
  if (time_s <= 0.0 && history_.begin() != nullptr) {
    state = moved(*history_.begin(), 0.0, time_s);
  } else {
    constexpr double kStep_s = StepHistory<FixedWingState>::kStep_s;
    const auto [before, after, since_s] = history_.at(time_s);
    const double part = since_s / kStep_s;
    turn_acceleration_rad_s2 = (after.turn_rate_rad_s - before.turn_rate_rad_s) / kStep_s;
    const double turn_rate_rad_s = before.turn_rate_rad_s + part * (after.turn_rate_rad_s - before.turn_rate_rad_s);
    state = moved(before, 0.5 * (before.turn_rate_rad_s + after.turn_rate_rad_s), since_s);
    state.turn_rate_rad_s = turn_rate_rad_s;
  }
  const Angle banked = bank(params_, state.turn_rate_rad_s, turn_acceleration_rad_s2);
  const Angle roll_gust = gust(0, params_.gust_rad, time_s), pitch_gust = gust(1, params_.gust_rad, time_s),
              yaw_gust = gust(2, params_.gust_rad, time_s);
  const Angle roll{-banked.rad + roll_gust.rad, -banked.rad_s + roll_gust.rad_s};
  const Angle pitch{-params_.nose_up_rad + pitch_gust.rad, pitch_gust.rad_s};
  const Angle yaw{state.T_world_robot.yaw_rad + yaw_gust.rad, state.turn_rate_rad_s + yaw_gust.rad_s};

  RobotState robot;
  robot.T_world_robot.linear() =
      (Eigen::AngleAxisd(yaw.rad, Eigen::Vector3d::UnitZ()) * Eigen::AngleAxisd(pitch.rad, Eigen::Vector3d::UnitY()) *
       Eigen::AngleAxisd(roll.rad, Eigen::Vector3d::UnitX()))
          .toRotationMatrix();
  robot.T_world_robot.translation() << state.T_world_robot.translation_m, height_m_;
  robot.velocity_world_m_s << velocity_of(state), 0.0;
  const double sin_roll = std::sin(roll.rad), cos_roll = std::cos(roll.rad);
  const double sin_pitch = std::sin(pitch.rad), cos_pitch = std::cos(pitch.rad);
  robot.angular_velocity_robot_rad_s << roll.rad_s - yaw.rad_s * sin_pitch,
      pitch.rad_s * cos_roll + yaw.rad_s * cos_pitch * sin_roll,
      -pitch.rad_s * sin_roll + yaw.rad_s * cos_pitch * cos_roll;
  return robot;
}

}  // namespace situation_awareness

// SPDX-License-Identifier: BSD-3-Clause
#include "situation_awareness/sim/unicycle.hpp"

#include <algorithm>
#include <cmath>

namespace situation_awareness {
namespace {

constexpr double kAtRest = 1e-3;  ///< m/s or rad/s from the command there is no lag, by which it would never get there

/// The rate after a step towards `command`.
double followed(double rate, double command, double rising, double falling, double lag_s) {
  const double missing = command - rate;
  const double most = (missing * rate < 0.0 ? falling : rising) * Unicycle::kStep_s;
  const double by_lag = std::abs(missing) < kAtRest ? missing : missing / lag_s * Unicycle::kStep_s;
  const double next = rate + std::clamp(by_lag, -most, most);
  return next * rate < 0.0 ? 0.0 : next;  // no braking on into the other direction within a step
}

/// The pose after moving at constant rates: an arc, by its chord.
Pose2 moved(const Pose2& T_world_robot, double speed_m_s, double yaw_rate_rad_s, double duration_s) {
  const double half_turn_rad = 0.5 * yaw_rate_rad_s * duration_s;
  const double sinc = std::abs(half_turn_rad) < 1e-6 ? 1.0 : std::sin(half_turn_rad) / half_turn_rad;
  const double chord_m = speed_m_s * duration_s * sinc, direction_rad = T_world_robot.yaw_rad + half_turn_rad;
  return {T_world_robot.translation_m + chord_m * Eigen::Vector2d(std::cos(direction_rad), std::sin(direction_rad)),
          T_world_robot.yaw_rad + 2.0 * half_turn_rad};
}

}  // namespace

Unicycle::Unicycle(const UnicycleParams& params, const Pose2& T_world_robot)
    : params_((params.validate(), params)), history_(UnicycleState{T_world_robot, 0.0, 0.0}) {}

void Unicycle::command(double speed_m_s, double yaw_rate_rad_s) {
  const bool is_finite = std::isfinite(speed_m_s) && std::isfinite(yaw_rate_rad_s);
  command_m_s_ = is_finite ? std::clamp(speed_m_s, -params_.max_speed_m_s, params_.max_speed_m_s) : 0.0;
  command_rad_s_ =
      is_finite ? std::clamp(yaw_rate_rad_s, -params_.max_yaw_rate_rad_s, params_.max_yaw_rate_rad_s) : 0.0;
  command_step_ = history_.steps();
}

void Unicycle::advance(double time_s) {
  for (std::int64_t missing = history_.missing(time_s); missing > 0; --missing) step();
}

void Unicycle::step() {
  if (static_cast<double>(history_.steps() - command_step_) * kStep_s >= params_.command_timeout_s) {
    command_m_s_ = command_rad_s_ = 0.0;
  }
  UnicycleState next = history_.latest();
  next.speed_m_s =
      followed(next.speed_m_s, command_m_s_, params_.acceleration_m_s2, params_.braking_m_s2, params_.lag_s);
  next.yaw_rate_rad_s = followed(next.yaw_rate_rad_s, command_rad_s_, params_.yaw_acceleration_rad_s2,
                                 params_.yaw_acceleration_rad_s2, params_.lag_s);
  next.T_world_robot = moved(next.T_world_robot, next.speed_m_s, next.yaw_rate_rad_s, kStep_s);
  history_.push(next);
}

UnicycleState Unicycle::at(double time_s) const {
  if (time_s <= 0.0 && history_.begin() != nullptr) return {history_.begin()->T_world_robot, 0.0, 0.0};
  const auto [before, after, since_s] = history_.at(time_s);
  if (&after == &before) return before;
  return {moved(before.T_world_robot, after.speed_m_s, after.yaw_rate_rad_s, since_s), after.speed_m_s,
          after.yaw_rate_rad_s};
}

}  // namespace situation_awareness

// SPDX-License-Identifier: BSD-3-Clause
#include "situation_awareness/sim/guided_multirotor.hpp"

#include <algorithm>
#include <cmath>
#include <cstdint>

#include "situation_awareness/geometry/angles.hpp"

namespace situation_awareness {
namespace {

PathState hovering(const Eigen::Vector3d& p_world_m, double yaw_rad) {
  PathState state;
  state.position_m = p_world_m;
  state.yaw_rad = yaw_rad;
  return state;
}

Eigen::Vector3d at_most(const Eigen::Vector3d& vector, double length) {
  const double norm = vector.norm();
  return norm > length ? Eigen::Vector3d(vector * (length / norm)) : vector;
}

}  // namespace

GuidedMultirotor::GuidedMultirotor(const GuidedMultirotorParams& params, const Eigen::Vector3d& p_world_m,
                                   double yaw_rad)
    : params_((params.validate(), params)),
      goal_m_(p_world_m),
      goal_yaw_rad_(yaw_rad),
      begin_(hovering(p_world_m, yaw_rad)),
      history_(begin_) {}

void GuidedMultirotor::go_to(const Eigen::Vector3d& p_world_m, double yaw_rad) {
  if (!p_world_m.allFinite() || !std::isfinite(yaw_rad)) return;
  goal_m_ = p_world_m;
  goal_yaw_rad_ = yaw_rad;
}

PathState GuidedMultirotor::next(const PathState& state, double step_s) const {
  const Eigen::Vector3d to_goal_m = goal_m_ - state.position_m;
  const double distance_m = to_goal_m.norm();
  const double speed_m_s = std::min({distance_m / params_.position_lag_s,
                                     std::sqrt(params_.max_acceleration_m_s2 * distance_m), params_.max_speed_m_s});
  const Eigen::Vector3d velocity_goal_m_s =
      distance_m > 1e-9 ? Eigen::Vector3d(to_goal_m * (speed_m_s / distance_m)) : Eigen::Vector3d::Zero();
  const Eigen::Vector3d acceleration_goal_m_s2 =
      at_most((velocity_goal_m_s - state.velocity_m_s) / params_.velocity_lag_s, params_.max_acceleration_m_s2);
  const double yaw_rate_goal_rad_s = std::clamp(wrap_to_pi(goal_yaw_rad_ - state.yaw_rad) / params_.yaw_lag_s,
                                                -params_.max_yaw_rate_rad_s, params_.max_yaw_rate_rad_s);

  PathState next = state;
  next.jerk_m_s3 = (acceleration_goal_m_s2 - state.acceleration_m_s2) / params_.acceleration_lag_s;
  next.acceleration_m_s2 += step_s * next.jerk_m_s3;
  next.velocity_m_s += 0.5 * step_s * (state.acceleration_m_s2 + next.acceleration_m_s2);
  next.position_m += 0.5 * step_s * (state.velocity_m_s + next.velocity_m_s);
  next.yaw_rate_rad_s += step_s / params_.acceleration_lag_s * (yaw_rate_goal_rad_s - state.yaw_rate_rad_s);
  next.yaw_rad += 0.5 * step_s * (state.yaw_rate_rad_s + next.yaw_rate_rad_s);
  return next;
}

void GuidedMultirotor::advance(double time_s) {
  for (std::int64_t missing = history_.missing(time_s); missing > 0; --missing) {
    history_.push(next(history_.latest(), StepHistory<PathState>::kStep_s));
  }
}

RobotState GuidedMultirotor::at(double time_s) const {
  if (time_s <= 0.0 && history_.begin() != nullptr) return multirotor_state(begin_, params_.drag_1_s);
  const auto [before, after, since_s] = history_.at(time_s);
  const double part = since_s / StepHistory<PathState>::kStep_s;
  const auto between = [part](const auto& a, const auto& b) { return a + part * (b - a); };
  PathState state;
  state.position_m =
      before.position_m + since_s * before.velocity_m_s + 0.5 * since_s * since_s * before.acceleration_m_s2;
  state.velocity_m_s = between(before.velocity_m_s, after.velocity_m_s);
  state.acceleration_m_s2 = between(before.acceleration_m_s2, after.acceleration_m_s2);
  state.jerk_m_s3 = after.jerk_m_s3;
  state.yaw_rad = between(before.yaw_rad, after.yaw_rad);
  state.yaw_rate_rad_s = between(before.yaw_rate_rad_s, after.yaw_rate_rad_s);
  return multirotor_state(state, params_.drag_1_s);
}

}  // namespace situation_awareness

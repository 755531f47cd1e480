// SPDX-License-Identifier: BSD-3-Clause
// How Circumnavigation knows where the vehicle is while odometry is missing, or does not move as it says.
#include <algorithm>
#include <cmath>

#include "situation_awareness/geometry/angles.hpp"
#include "situation_awareness/path/circumnavigation.hpp"

namespace situation_awareness {
namespace {

/// m, of the way that it says, of that or of its speed when flying. Odometry is looked at each so far: that moves less
/// is frozen; a vehicle that is slower does not fly.
constexpr double kFrozenWay_m = 2.0, kFrozen = 0.2;
/// s. Of dead reckoning, and until the wind is believed.
constexpr double kReckoning_s = 0.02, kWind_s = 5.0;

}  // namespace

/// Without a pose, or with one that cannot be: that by dead reckoning, and the sight placed by it.
MissionInput Circumnavigation::with_pose(const MissionInput& input, double since_s) {
  MissionInput placed = input;
  if (input.has_pose) {
    const double heading_rad = std::isnan(input.heading_rad) ? input.T_world_base.yaw_rad : input.heading_rad;
    check_motion(input, since_s);
    placed.has_pose = !is_frozen_;
    if (is_frozen_ && input.sight != nullptr) {
      // The sight was placed by that pose.
      const Pose2 T_base_world = inverse(Pose2{input.T_world_base.translation_m, heading_rad});
      sight_ = *input.sight;
      sight_.T_world_sensor = T_base_world * sight_.T_world_sensor;
      for (Eigen::Vector2d& hit_m : sight_.hits_world_m) hit_m = T_base_world * hit_m;
    }
  } else if (input.sight != nullptr) {
    sight_ = *input.sight;
  }
  is_lost_ = !placed.has_pose;
  reckon(placed, since_s);
  if (!is_lost_) return placed;
  placed.T_world_base = {reckoned_m_, std::atan2(velocity_m_s_.y(), velocity_m_s_.x())};
  placed.speed_m_s = velocity_m_s_.norm();
  placed.covariance_world.setZero();
  if (input.sight != nullptr) {
    const Pose2 T_world_body{reckoned_m_, heading_rad_};
    sight_.T_world_sensor = T_world_body * sight_.T_world_sensor;
    for (Eigen::Vector2d& hit_m : sight_.hits_world_m) hit_m = T_world_body * hit_m;
    placed.sight = &sight_;
  }
  return placed;
}

/// The vehicle turns as it was told, after its lag, and is carried by the wind.
void Circumnavigation::reckon(const MissionInput& input, double since_s) {
  const DubinsFollowingParams& vehicle = params_.following;
  const double airspeed_m_s = vehicle.airspeed_m_s;
  if (input.has_pose) {
    reckoned_m_ = input.T_world_base.translation_m;
    heading_rad_ = std::isnan(input.heading_rad) ? input.T_world_base.yaw_rad : input.heading_rad;
    const double course_rad = input.T_world_base.yaw_rad;
    velocity_m_s_ = input.speed_m_s * Eigen::Vector2d(std::cos(course_rad), std::sin(course_rad));
    const Eigen::Vector2d wind_m_s =
        velocity_m_s_ - airspeed_m_s * Eigen::Vector2d(std::cos(heading_rad_), std::sin(heading_rad_));
    const double part = started_ && !is_frozen_ ? std::min(since_s / kWind_s, 1.0) : 1.0;
    wind_m_s_ += part * (wind_m_s - wind_m_s_);
    turn_1_m_ = step_.curvature_1_m;
    return;
  }
  const double speed_m_s = airspeed_m_s > 0.0 ? airspeed_m_s : velocity_m_s_.norm();
  if (!(airspeed_m_s > 0.0)) wind_m_s_.setZero();
  const auto steps = static_cast<int>(std::ceil(std::min(since_s, 1.0) / kReckoning_s));
  for (int i = 0; i < steps; ++i) {
    const double step_s = std::min(since_s, 1.0) / steps;
    turn_1_m_ += (step_.curvature_1_m - turn_1_m_) * std::min(step_s / std::max(vehicle.reaction_s, step_s), 1.0);
    const double most_rad_s = vehicle.max_curvature_1_m * speed_m_s;
    const double turn_rad = std::clamp(turn_1_m_ * velocity_m_s_.norm(), -most_rad_s, most_rad_s) * step_s;
    const double middle_rad = heading_rad_ + 0.5 * turn_rad;
    heading_rad_ = wrap_to_pi(heading_rad_ + turn_rad);
    reckoned_m_ += (speed_m_s * Eigen::Vector2d(std::cos(middle_rad), std::sin(middle_rad)) + wind_m_s_) * step_s;
    velocity_m_s_ = speed_m_s * Eigen::Vector2d(std::cos(heading_rad_), std::sin(heading_rad_)) + wind_m_s_;
  }
}

/// Whether odometry says that the vehicle moves, and does not move so; or that it stands where it can only fly.
void Circumnavigation::check_motion(const MissionInput& input, double since_s) {
  if (!started_ || (is_lost_ && !is_frozen_)) {
    anchor_m_ = input.T_world_base.translation_m;
    flown_m_.setZero();
    is_frozen_ = false;
    since_s = 0.0;
  }
  const double course_rad = input.T_world_base.yaw_rad;
  flown_m_ += since_s * input.speed_m_s * Eigen::Vector2d(std::cos(course_rad), std::sin(course_rad));
  const bool stands = input.speed_m_s < kFrozen * params_.following.airspeed_m_s;
  is_frozen_ = is_frozen_ || stands;
  const double way_m = flown_m_.norm();
  if (way_m > kFrozenWay_m && !stands) {
    is_frozen_ = (input.T_world_base.translation_m - anchor_m_).dot(flown_m_) < kFrozen * way_m * way_m;
    anchor_m_ = input.T_world_base.translation_m;
    flown_m_.setZero();
  }
}

}  // namespace situation_awareness

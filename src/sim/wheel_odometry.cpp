// SPDX-License-Identifier: BSD-3-Clause
#include "situation_awareness/sim/wheel_odometry.hpp"

#include <cmath>

#include "seeds.hpp"
#include "situation_awareness/common/time.hpp"
#include "situation_awareness/geometry/angles.hpp"

namespace situation_awareness {

SimulatedOdometry::SimulatedOdometry(const World& world, const Eigen::Isometry3d& T_robot_base,
                                     const SimulatedOdometryParams& params, std::uint64_t seed)
    : world_(world), T_robot_base_(T_robot_base), params_(params), random_(seed_of_scan(seed, 0)) {
  params.validate();
  distance_scale_ = 1.0 + params.distance_scale_sigma * random_.normal();
  yaw_scale_ = 1.0 + params.yaw_scale_sigma * random_.normal();
  // Without it the random numbers are those of odometry that does not have it.
  if (params.yaw_drift_sigma > 0.0) yaw_drift_rad_m_ = params.yaw_drift_sigma * random_.normal();
  covariance_.setZero();
  covariance_(3, 3) = params.distance_scale_sigma * params.distance_scale_sigma;
  covariance_(4, 4) = params.yaw_scale_sigma * params.yaw_scale_sigma;
  covariance_(5, 5) = params.yaw_drift_sigma * params.yaw_drift_sigma;
}

Pose2 SimulatedOdometry::true_pose_at(double time_s) const {
  const Eigen::Isometry3d T = world_.robot_at(time_s).T_world_robot * T_robot_base_;
  return {T.translation().head<2>(), std::atan2(T(1, 0), T(0, 0))};
}

OdometrySample SimulatedOdometry::next() {
  const double time_s = next_time_s();
  OdometrySample sample;
  sample.stamp_ns = nanoseconds(time_s);
  if (samples_++ > 0) {
    const double period_s = 1.0 / params_.rate_hz;
    Pose2 motion = inverse(true_pose_at(time_s - period_s)) * true_pose_at(time_s);
    motion.yaw_rad = wrap_to_pi(motion.yaw_rad);
    const double distance_m = motion.translation_m.norm(), turn_rad = std::abs(motion.yaw_rad);
    const double distance_error_m = params_.distance_noise * std::sqrt(distance_m) * random_.normal();
    const double yaw_error_rad = params_.yaw_noise_of_distance * std::sqrt(distance_m) * random_.normal() +
                                 params_.yaw_noise_of_yaw * std::sqrt(turn_rad) * random_.normal();
    if (distance_m > 0.0) motion.translation_m *= distance_scale_ + distance_error_m / distance_m;
    motion.yaw_rad = yaw_scale_ * motion.yaw_rad + yaw_drift_rad_m_ * distance_m + yaw_error_rad;
    add_motion(motion, sample);
  }
  sample.T_odom_base = T_odom_base_;
  sample.pose_covariance = covariance_.topLeftCorner<3, 3>();
  return sample;
}

void SimulatedOdometry::add_motion(const Pose2& motion, OdometrySample& sample) {
  const auto square = [](double x) { return x * x; };
  const double distance_m = motion.translation_m.norm(), turn_rad = std::abs(motion.yaw_rad);
  const double distance_variance = square(params_.distance_noise) * distance_m;
  const double yaw_variance =
      square(params_.yaw_noise_of_distance) * distance_m + square(params_.yaw_noise_of_yaw) * turn_rad;
  const Eigen::Vector2d along_base =
      distance_m > 0.0 ? (motion.translation_m / distance_m).eval() : motion.translation_m;
  const Eigen::Rotation2Dd R_odom_base(T_odom_base_.yaw_rad);
  const Eigen::Vector2d step_odom_m = R_odom_base * motion.translation_m, along_odom = R_odom_base * along_base;

  // x' = x + s R(yaw) u, yaw' = yaw + r w + d |u|: the derivatives by yaw, by the scales s and r, and by the drift d.
  Eigen::Matrix<double, 6, 6> F = Eigen::Matrix<double, 6, 6>::Identity();
  F.block<2, 1>(0, 2) << -step_odom_m.y(), step_odom_m.x();
  F.block<2, 1>(0, 3) = step_odom_m;
  F(2, 4) = motion.yaw_rad;
  F(2, 5) = distance_m;
  covariance_ = F * covariance_ * F.transpose();
  covariance_.topLeftCorner<2, 2>() += distance_variance * along_odom * along_odom.transpose();
  covariance_(2, 2) += yaw_variance;

  T_odom_base_ = T_odom_base_ * motion;
  T_odom_base_.yaw_rad = wrap_to_pi(T_odom_base_.yaw_rad);
  const double period_s = 1.0 / params_.rate_hz;
  sample.velocity_base_m_s = motion.translation_m / period_s;
  sample.yaw_rate_rad_s = motion.yaw_rad / period_s;
  sample.twist_covariance.topLeftCorner<2, 2>() =
      (distance_variance + square(params_.distance_scale_sigma * distance_m)) / square(period_s) * along_base *
      along_base.transpose();
  sample.twist_covariance(2, 2) =
      (yaw_variance + square(params_.yaw_scale_sigma * turn_rad) + square(params_.yaw_drift_sigma * distance_m)) /
      square(period_s);
}

}  // namespace situation_awareness

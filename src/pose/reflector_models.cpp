// SPDX-License-Identifier: BSD-3-Clause
#include "situation_awareness/pose/reflector_models.hpp"

#include <cmath>

#include "situation_awareness/geometry/angles.hpp"
#include "situation_awareness/geometry/lie_groups.hpp"
#include "situation_awareness/pose/reflector_search.hpp"

namespace situation_awareness {

void WheelErrorParams::validate() const { check_bounds(*this, "localization.wheels"); }

Eigen::Matrix3d world_covariance(const Estimate<Pose2>& T_world_base) {
  Eigen::Matrix3d B = Eigen::Matrix3d::Identity();
  B.topLeftCorner<2, 2>() = T_world_base.x.rotation();
  return transformed(B, T_world_base.P);
}

Eigen::Vector2d observed_reflector(const Pose2& T_world_base, const Pose2& T_base_lidar,
                                   const Eigen::Vector2d& center_world_m) {
  const Eigen::Vector2d p_lidar = place_of(T_base_lidar, place_of(T_world_base, center_world_m));
  return {p_lidar.norm(), std::atan2(p_lidar.y(), p_lidar.x())};
}

Eigen::Matrix<double, 2, 3> observed_reflector_jacobian(const Pose2& T_world_base, const Pose2& T_base_lidar,
                                                        const Eigen::Vector2d& center_world_m) {
  const Eigen::Vector2d p_base = place_of(T_world_base, center_world_m);
  const Eigen::Vector2d p_lidar = place_of(T_base_lidar, p_base);
  const double range2_m2 = p_lidar.squaredNorm();
  Eigen::Matrix2d J_z_p;
  J_z_p << p_lidar.transpose() / std::sqrt(range2_m2), -p_lidar.y() / range2_m2, p_lidar.x() / range2_m2;
  return J_z_p * T_base_lidar.rotation().transpose() * place_jacobian(p_base);
}

Eigen::Matrix2d observed_reflector_place_jacobian(const Eigen::Matrix<double, 2, 3>& J_z_e, const Pose2& T_world_base) {
  return -J_z_e.leftCols<2>() * T_world_base.rotation().transpose();
}

namespace {

// Where no source is named, none is recorded; the sensitivity of these was not measured.

/// 1/sqrt(m). Random change of the constant errors, by distance, of that of turns by turning in rad.
constexpr double kScaleDrift = 0.001;
/// 1/sqrt(m). The same in proportion to the errors: wheels that are wrong by more change by more.
constexpr double kRelativeDrift = 0.2;

// The motion of the robot by that of its odometry.
Eigen::Vector3d corrected(const ReflectorState& x, const Eigen::Vector3d& tau, double turn_rad) {
  Eigen::Vector3d result = tau;
  result.head<2>() *= 1.0 + x.scale_error(0);
  result(2) += x.scale_error(1) * turn_rad + x.yaw_drift_rad_m * tau(0);
  return result;
}

}  // namespace

ReflectorState moved_by_odometry(const ReflectorState& x, const Pose2& u, double turn_rad) {
  return {x.T_world_base * exp_se2(corrected(x, log_se2(u), turn_rad)), x.scale_error, x.yaw_drift_rad_m};
}

Eigen::Matrix<double, 6, 6> moved_by_odometry_jacobian(const ReflectorState& x, const Pose2& u, double turn_rad) {
  const Eigen::Vector3d tau = log_se2(u);
  const Eigen::Vector3d scaled = corrected(x, tau, turn_rad);
  Eigen::Matrix3d J_tau_s;
  J_tau_s << tau(0), 0.0, 0.0, tau(1), 0.0, 0.0, 0.0, turn_rad, tau(0);
  Eigen::Matrix<double, 6, 6> F = Eigen::Matrix<double, 6, 6>::Identity();
  F.topLeftCorner<3, 3>() = adjoint_se2(inverse(exp_se2(scaled)));
  F.topRightCorner<3, 3>() = right_jacobian_se2(scaled) * J_tau_s;
  return F;
}

Eigen::Matrix<double, 6, 6> odometry_noise(const Pose2& u, const WheelErrorParams& params,
                                           const Eigen::Vector3d& wheel_error) {
  const double distance_m = u.translation_m.norm();
  const double turn_rad = std::abs(wrap_to_pi(u.yaw_rad));
  const auto variance = [](double noise, double way) { return noise * noise * way; };
  const auto drift = [&](double error, double way) {
    return variance(kScaleDrift, way) + variance(kRelativeDrift * error, way);
  };
  Eigen::Matrix<double, 6, 1> diagonal;
  diagonal << variance(params.distance_noise, distance_m), variance(params.lateral_noise, distance_m),
      variance(params.yaw_noise_of_distance, distance_m) + variance(params.yaw_noise_of_yaw, turn_rad),
      drift(wheel_error(0), distance_m), drift(wheel_error(1), turn_rad), drift(wheel_error(2), distance_m);
  return diagonal.asDiagonal();
}

}  // namespace situation_awareness

// SPDX-License-Identifier: BSD-3-Clause
#include <algorithm>
#include <cmath>

#include "situation_awareness/geometry/lie_groups.hpp"
#include "situation_awareness/pose/gps_ins_filter.hpp"

// What the filters expect to measure, and of what stands.
namespace situation_awareness {

using namespace navigation_error;

double standing_change(double standing_turn_rad_s, const InertialNoiseParams& noise) {
  // The difference of the means of neighbouring blocks has twice the variance of a mean by white noise, and 2/3 of that
  // of a block's duration by a walk.
  const double variance = 2.0 * noise.gyroscope_noise * noise.gyroscope_noise / InertialHistory::kBlock_s +
                          2.0 / 3.0 * noise.gyroscope_bias_walk * noise.gyroscope_bias_walk * InertialHistory::kBlock_s;
  return std::max(standing_turn_rad_s, kStandingSigmas * std::sqrt(variance));
}

void fix_innovation(const GpsInsState& x, const GpsInsMeasurement& fix, const GpsInsModel& model, const FixNoise& noise,
                    Eigen::Vector3d& nu, Eigen::Matrix<double, 3, 18>& H, Eigen::Matrix3d& R) {
  // The slow error is along the axes of the world; where those of the covariance are not, the rest stays white.
  const Eigen::Vector3d sigma = fix.covariance.diagonal().cwiseSqrt();
  const Eigen::Vector3d scale = std::sqrt(noise.correlated_share) * sigma;
  const Eigen::Matrix3d R_world_base = x.motion.q_world_imu.toRotationMatrix();
  nu = fix.value - x.motion.position_world_m - R_world_base * model.antenna_imu_m - scale.cwiseProduct(x.fix_error);
  H.setZero();
  H.block<3, 3>(0, kPosition).setIdentity();
  H.block<3, 3>(0, kAttitude) = -R_world_base * hat(model.antenna_imu_m);
  H.block<3, 3>(0, Manifold<GpsInsState>::kFixError) = scale.asDiagonal();
  const Eigen::Vector3d shift_m = model.fix_stamp_sigma_s * x.motion.velocity_world_m_s;
  R = (1.0 - noise.correlated_share) * fix.covariance + shift_m * shift_m.transpose();
  R.diagonal().array() += model.min_fix_sigma_m * model.min_fix_sigma_m;
}

double sideslip(const NavigationState& x, const Eigen::Vector3d& rate_rad_s, const Eigen::Vector3d& lever_m) {
  return x.velocity_world_m_s.dot(x.q_world_imu * Eigen::Vector3d::UnitY()) -
         (rate_rad_s - x.gyroscope_bias_rad_s).cross(lever_m).y();
}

Eigen::Matrix<double, 1, 18> sideslip_jacobian(const NavigationState& x, const Eigen::Vector3d& lever_m) {
  const Eigen::Matrix3d R = x.q_world_imu.toRotationMatrix();
  Eigen::Matrix<double, 1, 18> H = Eigen::Matrix<double, 1, 18>::Zero();
  H.segment<3>(kVelocity) = R.col(1).transpose();
  H.segment<3>(kAttitude) = hat(R.transpose() * x.velocity_world_m_s).row(1);
  H.segment<3>(kGyroscopeBias) = -hat(lever_m).row(1);
  return H;
}

}  // namespace situation_awareness

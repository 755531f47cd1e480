// SPDX-License-Identifier: BSD-3-Clause
#include "situation_awareness/pose/inertial_motion.hpp"

#include <algorithm>
#include <cmath>

#include "situation_awareness/geometry/lie_groups.hpp"

namespace situation_awareness {

using namespace navigation_error;

namespace {

/// The turn of a step and of its half, with the right Jacobian of each.
struct StepTurn {
  Eigen::Quaterniond half, whole;
  Eigen::Matrix3d half_jacobian, whole_jacobian;
};

/// A turn below 0.1 rad by series, exact to rounding, in a third of the time: a late fix repeats many steps.
StepTurn turned_by(const Eigen::Vector3d& phi) {
  const double x = phi.squaredNorm();
  if (x > 1e-2) {
    const Eigen::Vector3d half = 0.5 * phi;
    return {exp_so3(half), exp_so3(phi), right_jacobian_so3(half), right_jacobian_so3(phi)};
  }
  const auto cosine = [](double square) {
    return 1.0 - square / 2.0 * (1.0 - square / 12.0 * (1.0 - square / 30.0 * (1.0 - square / 56.0)));
  };
  const auto sine_over = [](double square) {
    return 1.0 - square / 6.0 * (1.0 - square / 20.0 * (1.0 - square / 42.0 * (1.0 - square / 72.0)));
  };
  const Eigen::Matrix3d across = hat(phi), square_across = phi * phi.transpose() - x * Eigen::Matrix3d::Identity();
  const auto quaternion = [&](double part) {
    const double half = 0.5 * part, square = half * half * x;
    const Eigen::Vector3d v = half * sine_over(square) * phi;
    return Eigen::Quaterniond(cosine(square), v.x(), v.y(), v.z());
  };
  const auto jacobian = [&](double part) -> Eigen::Matrix3d {
    const double square = part * part * x, sinc = sine_over(0.25 * square);
    const double third = (1.0 - square / 20.0 * (1.0 - square / 42.0 * (1.0 - square / 72.0))) / 6.0;
    return Eigen::Matrix3d::Identity() - (part * 0.5 * sinc * sinc) * across + (part * part * third) * square_across;
  };
  return {quaternion(0.5), quaternion(1.0), jacobian(0.5), jacobian(1.0)};
}

NavigationState moved(const NavigationState& x, const Eigen::Vector3d& force, const StepTurn& turn, double dt_s) {
  // The force is given in the axes of the body half way through the step.
  const Eigen::Vector3d acceleration =
      x.q_world_imu * (turn.half * force) - kStandardGravity_m_s2 * Eigen::Vector3d::UnitZ();
  NavigationState y = x;
  y.position_world_m += dt_s * x.velocity_world_m_s + 0.5 * dt_s * dt_s * acceleration;
  y.velocity_world_m_s += dt_s * acceleration;
  y.q_world_imu = (x.q_world_imu * turn.whole).normalized();
  return y;
}

}  // namespace

NavigationState moved_by_imu(const NavigationState& x, const Eigen::Vector3d& specific_force_m_s2,
                             const Eigen::Vector3d& angular_velocity_rad_s, double dt_s) {
  return moved(x, specific_force_m_s2 - x.accelerometer_bias_m_s2,
               turned_by(dt_s * (angular_velocity_rad_s - x.gyroscope_bias_rad_s)), dt_s);
}

NavigationState MotionJacobian::append(const NavigationState& x, const Eigen::Vector3d& specific_force_m_s2,
                                       const Eigen::Vector3d& angular_velocity_rad_s, double dt_s) {
  const Eigen::Vector3d force = specific_force_m_s2 - x.accelerometer_bias_m_s2;
  const StepTurn turn = turned_by(dt_s * (angular_velocity_rad_s - x.gyroscope_bias_rad_s));
  const Eigen::Matrix3d half_turn = turn.half.toRotationMatrix();
  const Eigen::Matrix3d R_half = x.q_world_imu.toRotationMatrix() * half_turn;
  const Eigen::Matrix3d a_by_accelerometer = -R_half;
  const Eigen::Matrix3d R_half_force = R_half * hat(force);
  const Eigen::Matrix3d a_by_attitude = -R_half_force * half_turn.transpose();  // as hat(R v) = R hat(v) R^T
  const Eigen::Matrix3d a_by_gyroscope = 0.5 * dt_s * R_half_force * turn.half_jacobian;
  const Eigen::Matrix3d turn_back = turn.whole.conjugate().toRotationMatrix();

  const Eigen::Matrix3d a_attitude = a_by_attitude * attitude_by_attitude;
  const Eigen::Matrix3d a_gyroscope = a_by_attitude * attitude_by_gyroscope + a_by_gyroscope;
  const double half_square = 0.5 * dt_s * dt_s;
  position_by_attitude += dt_s * velocity_by_attitude + half_square * a_attitude;
  position_by_accelerometer += dt_s * velocity_by_accelerometer + half_square * a_by_accelerometer;
  position_by_gyroscope += dt_s * velocity_by_gyroscope + half_square * a_gyroscope;
  velocity_by_attitude += dt_s * a_attitude;
  velocity_by_accelerometer += dt_s * a_by_accelerometer;
  velocity_by_gyroscope += dt_s * a_gyroscope;
  attitude_by_attitude = (turn_back * attitude_by_attitude).eval();
  attitude_by_gyroscope = turn_back * attitude_by_gyroscope - dt_s * turn.whole_jacobian;
  duration_s += dt_s;
  return moved(x, force, turn, dt_s);
}

ErrorMatrix<NavigationState> MotionJacobian::matrix() const {
  ErrorMatrix<NavigationState> F = ErrorMatrix<NavigationState>::Identity();
  F.block<3, 3>(kPosition, kVelocity) = duration_s * Eigen::Matrix3d::Identity();
  F.block<3, 3>(kPosition, kAttitude) = position_by_attitude;
  F.block<3, 3>(kPosition, kAccelerometerBias) = position_by_accelerometer;
  F.block<3, 3>(kPosition, kGyroscopeBias) = position_by_gyroscope;
  F.block<3, 3>(kVelocity, kAttitude) = velocity_by_attitude;
  F.block<3, 3>(kVelocity, kAccelerometerBias) = velocity_by_accelerometer;
  F.block<3, 3>(kVelocity, kGyroscopeBias) = velocity_by_gyroscope;
  F.block<3, 3>(kAttitude, kAttitude) = attitude_by_attitude;
  F.block<3, 3>(kAttitude, kGyroscopeBias) = attitude_by_gyroscope;
  return F;
}

double kept_of_fix_error(double duration_s, double correlation_s) { return std::exp(-duration_s / correlation_s); }

ErrorMatrix<GpsInsState> moved_covariance(const ErrorMatrix<GpsInsState>& P, const MotionJacobian& J,
                                          const InertialNoiseParams& noise, double correlation_s) {
  constexpr int kFixError = Manifold<GpsInsState>::kFixError;
  const double dt_s = J.duration_s;
  if (dt_s <= 0.0) return P;
  // Only the rows of position, velocity and attitude of F are not those of the identity: a third of the products.
  const Eigen::Matrix<double, 9, kSize> F = J.matrix().topRows<9>();
  const Eigen::Matrix<double, 9, 18> FP = F.lazyProduct(P.topRows<kSize>());
  const double kept = kept_of_fix_error(dt_s, correlation_s);
  ErrorMatrix<GpsInsState> result = P;
  Eigen::Matrix<double, 9, 9> motion = FP.leftCols<kSize>().lazyProduct(F.transpose());
  const Eigen::Matrix<double, 9, 3> L_a = F.middleCols<3>(kAccelerometerBias);
  const Eigen::Matrix<double, 9, 3> L_g = F.middleCols<3>(kGyroscopeBias);
  motion += (noise.accelerometer_noise * noise.accelerometer_noise / dt_s) * L_a.lazyProduct(L_a.transpose()) +
            (noise.gyroscope_noise * noise.gyroscope_noise / dt_s) * L_g.lazyProduct(L_g.transpose());
  result.topLeftCorner<9, 9>() = 0.5 * (motion + motion.transpose());
  result.block<9, 6>(0, 9) = FP.middleCols<6>(9);
  result.block<9, 3>(0, kFixError) = kept * FP.rightCols<3>();
  result.block<6, 3>(9, kFixError) *= kept;
  result.block<3, 3>(kFixError, kFixError) *= kept * kept;
  result.block<6, 9>(9, 0) = result.block<9, 6>(0, 9).transpose();
  result.block<3, 15>(kFixError, 0) = result.block<15, 3>(0, kFixError).transpose();
  result.diagonal().segment<3>(kAccelerometerBias).array() +=
      noise.accelerometer_bias_walk * noise.accelerometer_bias_walk * dt_s;
  result.diagonal().segment<3>(kGyroscopeBias).array() += noise.gyroscope_bias_walk * noise.gyroscope_bias_walk * dt_s;
  result.diagonal().segment<3>(kFixError).array() += 1.0 - kept * kept;
  return result;
}

double yaw_of(const Eigen::Quaterniond& q_world_body) {
  const Eigen::Vector3d ahead = q_world_body * Eigen::Vector3d::UnitX();
  return std::atan2(ahead.y(), ahead.x());
}

Eigen::RowVector3d yaw_jacobian(const Eigen::Quaterniond& q_world_body) {
  // ahead' = R (e_x + delta x e_x) = R e_x + delta_z R e_y - delta_y R e_z
  const Eigen::Matrix3d R = q_world_body.toRotationMatrix();
  const double square = std::max(R(0, 0) * R(0, 0) + R(1, 0) * R(1, 0), 1e-12);
  const auto turned_by = [&](int axis) { return (R(0, 0) * R(1, axis) - R(1, 0) * R(0, axis)) / square; };
  return {0.0, -turned_by(2), turned_by(1)};
}

}  // namespace situation_awareness

// SPDX-License-Identifier: BSD-3-Clause
#include "situation_awareness/pose/inertial_motion.hpp"

#include <algorithm>
#include <cmath>

#include "situation_awareness/geometry/lie_groups.hpp"

namespace situation_awareness {

using namespace navigation_error;

namespace {

/// A turn with its right Jacobian.
struct Turn {
  Eigen::Quaterniond q;
  Eigen::Matrix3d jacobian;
};

/// Those of a step and of its half.
struct StepTurn {
  Turn half, whole;
};

/// A turn below 0.1 rad by series, exact to rounding: a late fix repeats many steps.
StepTurn turned_by(const Eigen::Vector3d& phi) {
  const double x = phi.squaredNorm();
  if (x > 1e-2) {
    const Eigen::Vector3d half = 0.5 * phi;
    return {{exp_so3(half), right_jacobian_so3(half)}, {exp_so3(phi), right_jacobian_so3(phi)}};
  }
  const Eigen::Matrix3d across = hat(phi), square_across = phi * phi.transpose() - x * Eigen::Matrix3d::Identity();
  const auto part_of_it = [&](double part) -> Turn {
    const double s = part * part * x, h = 0.25 * s;  // squares of its angle, and of half of that
    const double cosine = 1.0 - h * (1.0 / 2.0 - h * (1.0 / 24.0 - h * (1.0 / 720.0 - h / 40320.0)));
    const double sinc = 1.0 - h * (1.0 / 6.0 - h * (1.0 / 120.0 - h * (1.0 / 5040.0 - h / 362880.0)));
    const double third = 1.0 / 6.0 - s * (1.0 / 120.0 - s * (1.0 / 5040.0 - s / 362880.0));
    const Eigen::Vector3d v = 0.5 * part * sinc * phi;
    return {Eigen::Quaterniond(cosine, v.x(), v.y(), v.z()),
            Eigen::Matrix3d::Identity() - (part * 0.5 * sinc * sinc) * across + (part * part * third) * square_across};
  };
  return {part_of_it(0.5), part_of_it(1.0)};
}

}  // namespace

NavigationState MotionJacobian::append(const NavigationState& x, const Eigen::Vector3d& specific_force_m_s2,
                                       const Eigen::Vector3d& angular_velocity_rad_s, double dt_s) {
  const StepTurn turn = turned_by(dt_s * (angular_velocity_rad_s - x.gyroscope_bias_rad_s));
  const Eigen::Matrix3d R = x.q_world_imu.toRotationMatrix(), half_turn = turn.half.q.toRotationMatrix();
  // What is measured is along the axes of the body half way through the step; this is along those at its begin.
  const Eigen::Vector3d force = half_turn * (specific_force_m_s2 - x.accelerometer_bias_m_s2);
  const Eigen::Matrix3d by_attitude = -R * hat(force);
  const Eigen::Matrix3d turn_back = turn.whole.q.conjugate().toRotationMatrix();

  // Of the acceleration by the error before all steps, columns as in `translation`. By the gyroscope's bias the half
  // turn changes as the attitude of x would by its left Jacobian, which is the transposed right one.
  Eigen::Matrix<double, 3, 9> acceleration;
  acceleration << by_attitude * attitude_by_attitude, -R * half_turn,
      by_attitude * (attitude_by_gyroscope - 0.5 * dt_s * turn.half.jacobian.transpose());
  translation.topRows<3>() += dt_s * translation.bottomRows<3>() + 0.5 * dt_s * dt_s * acceleration;
  translation.bottomRows<3>() += dt_s * acceleration;
  attitude_by_attitude = (turn_back * attitude_by_attitude).eval();
  attitude_by_gyroscope = turn_back * attitude_by_gyroscope - dt_s * turn.whole.jacobian;
  duration_s += dt_s;

  const Eigen::Vector3d acceleration_world_m_s2 = R * force - kStandardGravity_m_s2 * Eigen::Vector3d::UnitZ();
  NavigationState y = x;
  y.position_world_m += dt_s * x.velocity_world_m_s + 0.5 * dt_s * dt_s * acceleration_world_m_s2;
  y.velocity_world_m_s += dt_s * acceleration_world_m_s2;
  y.q_world_imu = (x.q_world_imu * turn.whole.q).normalized();
  return y;
}

ErrorMatrix<NavigationState> MotionJacobian::matrix() const {
  ErrorMatrix<NavigationState> F = ErrorMatrix<NavigationState>::Identity();
  F.block<3, 3>(kPosition, kVelocity) = duration_s * Eigen::Matrix3d::Identity();
  F.block<6, 9>(kPosition, kAttitude) = translation;
  F.block<3, 3>(kAttitude, kAttitude) = attitude_by_attitude;
  F.block<3, 3>(kAttitude, kGyroscopeBias) = attitude_by_gyroscope;
  return F;
}

double significant_share(double mahalanobis2) {
  constexpr double kInsignificant = 9.0;
  return mahalanobis2 > kInsignificant ? 1.0 - kInsignificant / mahalanobis2 : 0.0;
}

YawEffect leave_out_insignificant(MotionJacobian& J, const Eigen::Quaterniond& q_world_body,
                                  const ErrorMatrix<GpsInsState>& P, const InertialNoiseParams& noise) {
  // By the attitude the velocity changes by -[w] R, with w the integral of the force in the world: an angle about the
  // vertical turns the horizontal part of w, and that of the position likewise.
  YawEffect effect;
  const Eigen::Vector3d up_body = q_world_body.conjugate() * Eigen::Vector3d::UnitZ();
  const Eigen::Matrix<double, 6, 1> by_yaw = J.translation.leftCols<3>() * up_body;
  const Eigen::Vector2d turned = by_yaw.segment<2>(3);  // the gain of velocity, turned by a right angle
  Eigen::Matrix<double, 2, 6> B = J.translation.block<2, 6>(3, 0);
  B.leftCols<3>() -= turned * up_body.transpose();
  const Eigen::Matrix<double, 2, 6> BP = B.lazyProduct(P.block<6, 6>(kAttitude, kAttitude));
  Eigen::Matrix2d C = BP.lazyProduct(B.transpose());
  C.diagonal().array() += noise.accelerometer_noise * noise.accelerometer_noise * J.duration_s;
  const double determinant = C.determinant();
  if (!(determinant > 0.0)) return effect;
  const Eigen::Vector2d gain(turned.y(), -turned.x());
  const double mahalanobis2 =
      (C(1, 1) * gain.x() * gain.x() - 2.0 * C(0, 1) * gain.x() * gain.y() + C(0, 0) * gain.y() * gain.y()) /
      determinant;
  effect.share_left = significant_share(mahalanobis2);
  effect.left_out = (1.0 - effect.share_left) * by_yaw;
  J.translation.leftCols<3>() -= effect.left_out * up_body.transpose();
  return effect;
}

double vertical_variance(const Eigen::Quaterniond& q_world_body, const ErrorMatrix<GpsInsState>& P) {
  const Eigen::Vector3d up_body = q_world_body.conjugate() * Eigen::Vector3d::UnitZ();
  return up_body.dot(P.block<3, 3>(kAttitude, kAttitude) * up_body);
}

bool is_finite(const GpsInsState& x) {
  return x.motion.position_world_m.allFinite() && x.motion.velocity_world_m_s.allFinite() &&
         x.motion.q_world_imu.coeffs().allFinite() && x.motion.accelerometer_bias_m_s2.allFinite() &&
         x.motion.gyroscope_bias_rad_s.allFinite() && x.fix_error.allFinite();
}

double kept_of_fix_error(double duration_s, double correlation_s) { return std::exp(-duration_s / correlation_s); }

ErrorMatrix<GpsInsState> moved_covariance(const ErrorMatrix<GpsInsState>& P, const MotionJacobian& J,
                                          const InertialNoiseParams& noise, double correlation_s) {
  constexpr int kFixError = Manifold<GpsInsState>::kFixError;
  const double dt_s = J.duration_s;
  if (dt_s <= 0.0) return P;
  // Block by block, without those of F that are zero or the identity: a sixth of the products.
  Eigen::Matrix<double, 18, 9> PFt;  // without the rows of F that are those of the identity
  PFt.leftCols<6>() = P.middleCols<9>(kAttitude).lazyProduct(J.translation.transpose());
  PFt.leftCols<3>() += P.leftCols<3>() + dt_s * P.middleCols<3>(kVelocity);
  PFt.middleCols<3>(kVelocity) += P.middleCols<3>(kVelocity);
  PFt.rightCols<3>() = P.middleCols<3>(kAttitude).lazyProduct(J.attitude_by_attitude.transpose()) +
                       P.middleCols<3>(kGyroscopeBias).lazyProduct(J.attitude_by_gyroscope.transpose());
  const double kept = kept_of_fix_error(dt_s, correlation_s);
  ErrorMatrix<GpsInsState> result = P;
  result.block<6, 9>(9, 0) = PFt.middleRows<6>(9);
  result.block<3, 9>(kFixError, 0) = kept * PFt.bottomRows<3>();
  result.block<3, 6>(kFixError, 9) *= kept;
  result.block<3, 3>(kFixError, kFixError) *= kept * kept;
  result.block<9, 6>(0, 9) = result.block<6, 9>(9, 0).transpose();
  result.block<15, 3>(0, kFixError) = result.block<3, 15>(kFixError, 0).transpose();

  const double q_a = noise.accelerometer_noise * noise.accelerometer_noise / dt_s;
  const double q_g = noise.gyroscope_noise * noise.gyroscope_noise / dt_s;
  PFt.block<3, 6>(kAccelerometerBias, 0) += q_a * J.translation.middleCols<3>(3).transpose();
  PFt.block<3, 6>(kGyroscopeBias, 0) += q_g * J.translation.rightCols<3>().transpose();
  PFt.block<3, 3>(kGyroscopeBias, kAttitude) += q_g * J.attitude_by_gyroscope.transpose();
  Eigen::Matrix<double, 9, 9> motion;
  motion.topRows<6>() = J.translation.lazyProduct(PFt.middleRows<9>(kAttitude));
  motion.topRows<3>() += PFt.topRows<3>() + dt_s * PFt.middleRows<3>(kVelocity);
  motion.middleRows<3>(kVelocity) += PFt.middleRows<3>(kVelocity);
  motion.bottomRows<3>() = J.attitude_by_attitude.lazyProduct(PFt.middleRows<3>(kAttitude)) +
                           J.attitude_by_gyroscope.lazyProduct(PFt.middleRows<3>(kGyroscopeBias));
  result.topLeftCorner<9, 9>() = 0.5 * (motion + motion.transpose());
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

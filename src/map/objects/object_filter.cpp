// SPDX-License-Identifier: BSD-3-Clause
#include "situation_awareness/map/objects/object_filter.hpp"

#include <cmath>
#include <utility>

#include <Eigen/Cholesky>

#include "situation_awareness/geometry/angles.hpp"

namespace situation_awareness {

using namespace object_error;

namespace {

/// d(R p) / d(angle) = hat(R p): a quarter turn.
Eigen::Vector2d quarter_turn(const Eigen::Vector2d& p) { return {-p.y(), p.x()}; }

}  // namespace

ObjectState boxplus(const ObjectState& x, const Vector8d& dx) {
  ObjectState result = x;
  result.position_world_m += dx.segment<2>(kPosition);
  result.velocity_world_m_s += dx.segment<2>(kVelocity);
  result.orientation_world *= std::polar(1.0, dx(kOrientation));
  result.orientation_world /= std::abs(result.orientation_world);  // keep rounding from adding up
  result.angular_velocity_rad_s += dx(kAngularVelocity);
  result.radii_m += dx.segment<2>(kRadii);
  return result;
}

Vector8d boxminus(const ObjectState& a, const ObjectState& b) {
  Vector8d dx;
  dx.segment<2>(kPosition) = a.position_world_m - b.position_world_m;
  dx.segment<2>(kVelocity) = a.velocity_world_m_s - b.velocity_world_m_s;
  dx(kOrientation) = std::arg(a.orientation_world * std::conj(b.orientation_world));
  dx(kAngularVelocity) = a.angular_velocity_rad_s - b.angular_velocity_rad_s;
  dx.segment<2>(kRadii) = a.radii_m - b.radii_m;
  return dx;
}

ObjectState predict(const ObjectState& x, double dt_s) {
  Vector8d dx = Vector8d::Zero();
  dx.segment<2>(kPosition) = dt_s * x.velocity_world_m_s;
  dx(kOrientation) = dt_s * x.angular_velocity_rad_s;
  return boxplus(x, dx);
}

Matrix8d process_jacobian(double dt_s) {
  Matrix8d F = Matrix8d::Identity();
  F.block<2, 2>(kPosition, kVelocity) = dt_s * Eigen::Matrix2d::Identity();
  F(kOrientation, kAngularVelocity) = dt_s;
  return F;
}

Matrix8d process_covariance(double dt_s, const ProcessNoise& noise) {
  Matrix8d Q = Matrix8d::Zero();
  const auto add_integrated = [&](int value, int rate, double density) {
    const double q = density * density;
    Q(value, value) = q * dt_s * dt_s * dt_s / 3.0;
    Q(value, rate) = Q(rate, value) = q * dt_s * dt_s / 2.0;
    Q(rate, rate) = q * dt_s;
  };
  add_integrated(kPosition, kVelocity, noise.acceleration);
  add_integrated(kPosition + 1, kVelocity + 1, noise.acceleration);
  add_integrated(kOrientation, kAngularVelocity, noise.angular_acceleration);
  Q(kRadii, kRadii) = Q(kRadii + 1, kRadii + 1) = noise.radius * noise.radius * dt_s;
  return Q;
}

Ellipse measure(const ObjectState& x, const Pose2& T_world_level) {
  const Ellipse ellipse_world{x.position_world_m, std::arg(x.orientation_world), x.radii_m.x(), x.radii_m.y()};
  return inverse(T_world_level) * ellipse_world;
}

Vector5d innovation(const Ellipse& measured_level, const Ellipse& predicted_level) {
  Vector5d nu;
  nu << measured_level.center_m - predicted_level.center_m,
      wrap_to_pi(measured_level.psi_rad - predicted_level.psi_rad), measured_level.rx_m - predicted_level.rx_m,
      measured_level.ry_m - predicted_level.ry_m;
  return nu;
}

Matrix58d measurement_jacobian(const Pose2& T_world_level) {
  Matrix58d H = Matrix58d::Zero();
  H.block<2, 2>(0, kPosition) = T_world_level.rotation().transpose();
  H(2, kOrientation) = 1.0;
  H.block<2, 2>(3, kRadii).setIdentity();
  return H;
}

Matrix53d measurement_input_jacobian(const ObjectState& x, const Pose2& T_world_level) {
  const Eigen::Matrix2d R_level_world = T_world_level.rotation().transpose();
  Matrix53d H_u = Matrix53d::Zero();
  H_u.topLeftCorner<2, 2>() = -R_level_world;
  H_u.block<2, 1>(0, 2) = -quarter_turn(R_level_world * (x.position_world_m - T_world_level.translation_m));
  H_u(2, 2) = -1.0;
  return H_u;
}

ObjectState map_measurement(const Ellipse& measured_level, const Pose2& T_world_level) {
  const Ellipse ellipse_world = T_world_level * measured_level;
  ObjectState x;
  x.position_world_m = ellipse_world.center_m;
  x.orientation_world = std::polar(1.0, ellipse_world.psi_rad);
  x.radii_m = {ellipse_world.rx_m, ellipse_world.ry_m};
  return x;
}

Eigen::Matrix<double, 8, 5> mapping_jacobian(const Pose2& T_world_level) {
  Eigen::Matrix<double, 8, 5> G = Eigen::Matrix<double, 8, 5>::Zero();
  G.block<2, 2>(kPosition, 0) = T_world_level.rotation();
  G(kOrientation, 2) = 1.0;
  G.block<2, 2>(kRadii, 3).setIdentity();
  return G;
}

Eigen::Matrix<double, 8, 3> mapping_input_jacobian(const Ellipse& measured_level, const Pose2& T_world_level) {
  Eigen::Matrix<double, 8, 3> G_u = Eigen::Matrix<double, 8, 3>::Zero();
  G_u.block<2, 2>(kPosition, 0).setIdentity();
  G_u.block<2, 1>(kPosition, 2) = quarter_turn(T_world_level.rotation() * measured_level.center_m);
  G_u(kOrientation, 2) = 1.0;
  return G_u;
}

std::array<Measurement, 4> equivalent_measurements(const Measurement& measurement) {
  Measurement turned = measurement;
  turned.ellipse_level.psi_rad += kPi;
  std::array<Measurement, 4> result{measurement, turned, measurement, turned};
  for (std::size_t i : {2U, 3U}) {
    Measurement& swapped = result[i];
    swapped.ellipse_level.psi_rad += kPi / 2.0;
    std::swap(swapped.ellipse_level.rx_m, swapped.ellipse_level.ry_m);
    swapped.covariance.row(3).swap(swapped.covariance.row(4));
    swapped.covariance.col(3).swap(swapped.covariance.col(4));
  }
  return result;
}

Match match(const ObjectState& x, const Matrix8d& P, const Pose2& T_world_level, const Measurement& measurement,
            const Eigen::Matrix3d& robot_covariance) {
  const Ellipse predicted_level = measure(x, T_world_level);
  const Matrix58d H = measurement_jacobian(T_world_level);
  const Matrix53d H_u = measurement_input_jacobian(x, T_world_level);
  const Matrix5d S_state = H * P * H.transpose() + H_u * robot_covariance * H_u.transpose();

  Match best;
  bool found = false;
  for (const Measurement& candidate : equivalent_measurements(measurement)) {
    const Vector5d nu = innovation(candidate.ellipse_level, predicted_level);
    const Matrix5d S = S_state + candidate.covariance;
    const Eigen::LLT<Matrix5d> llt(S);
    const double mahalanobis2 = llt.matrixL().solve(nu).squaredNorm();
    if (found && !(mahalanobis2 < best.mahalanobis2)) continue;
    const double log_det_S = 2.0 * llt.matrixLLT().diagonal().array().log().sum();
    best = {candidate, nu, S, mahalanobis2, log_det_S};
    found = true;
  }
  return best;
}

void update(ObjectState& x, Matrix8d& P, const Pose2& T_world_level, const Match& match,
            const Eigen::Matrix3d& robot_covariance) {
  const Matrix58d H = measurement_jacobian(T_world_level);
  const Matrix53d H_u = measurement_input_jacobian(x, T_world_level);
  const Matrix5d R = match.measurement.covariance + H_u * robot_covariance * H_u.transpose();
  const Eigen::Matrix<double, 8, 5> K = match.S.llt().solve(H * P).transpose();
  const Matrix8d I_KH = Matrix8d::Identity() - K * H;
  const Matrix8d corrected = I_KH * P * I_KH.transpose() + K * R * K.transpose();
  P = 0.5 * (corrected + corrected.transpose());
  x = boxplus(x, K * match.nu);
}

void make_canonical(ObjectState& x, Matrix8d& P) {
  if (x.radii_m.x() >= x.radii_m.y()) return;
  std::swap(x.radii_m.x(), x.radii_m.y());
  x.orientation_world *= std::complex<double>(0.0, 1.0);
  P.row(kRadii).swap(P.row(kRadii + 1));
  P.col(kRadii).swap(P.col(kRadii + 1));
}

}  // namespace situation_awareness

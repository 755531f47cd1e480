// SPDX-License-Identifier: BSD-3-Clause
#include "situation_awareness/map/objects/object_filter.hpp"

#include <algorithm>
#include <cmath>

#include <Eigen/LU>

#include "situation_awareness/geometry/angles.hpp"

namespace situation_awareness {

using namespace object_state;

namespace {

constexpr int kAxis = kShape + 1;  // (p, q) in x

/// d(R p) / d(angle) = hat(R p): rotation by 90 degrees.
Eigen::Vector2d quarter_turn(const Eigen::Vector2d& p) { return {-p.y(), p.x()}; }

Eigen::Matrix2d turn(double angle_rad) { return Eigen::Rotation2Dd(angle_rad).toRotationMatrix(); }

/// A rotation with this variance is unknown. A larger one has no meaning, and its rounding errors would exceed the
/// covariance of the radii.
constexpr double kAnyTurn_rad = 30.0;

/// Below it the integrals of a turn are series, whose first terms left out are of its fourth power.
constexpr double kSmallTurn_rad = 1e-3;

/// d(p, q) / d(psi) after `dt_s`.
Eigen::Vector2d axis_by_psi(const Vector8d& x, double dt_s) {
  return 2.0 * quarter_turn(turn(2.0 * dt_s * x(kAngularVelocity)) * x.segment<2>(kAxis));
}

/// Integrals of cos(t a) and sin(t a) over t in [0, 1], and their derivatives by the angle a.
struct MeanTurn {
  double cosine, sine, cosine_by_angle, sine_by_angle;
};

MeanTurn mean_turn(double angle_rad) {
  if (std::abs(angle_rad) < kSmallTurn_rad) {
    const double a2 = angle_rad * angle_rad;
    return {1.0 - a2 / 6.0, angle_rad * (0.5 - a2 / 24.0), -angle_rad / 3.0, 0.5 - a2 / 8.0};
  }
  const double cosine = std::sin(angle_rad) / angle_rad;
  const double sine = (1.0 - std::cos(angle_rad)) / angle_rad;
  return {cosine, sine, (std::cos(angle_rad) - cosine) / angle_rad, (std::sin(angle_rad) - sine) / angle_rad};
}

/// The rows of position and velocity where the velocity turns.
void turn_course(const Vector8d& x, double dt_s, Matrix8d& F) {
  const double angle_rad = dt_s * x(kAngularVelocity);
  const Eigen::Vector2d v = x.segment<2>(kVelocity);
  const MeanTurn mean = mean_turn(angle_rad);
  F.block<2, 2>(kPosition, kVelocity) << mean.cosine, -mean.sine, mean.sine, mean.cosine;
  F.block<2, 2>(kPosition, kVelocity) *= dt_s;
  F.block<2, 1>(kPosition, kAngularVelocity) =
      dt_s * dt_s * (mean.cosine_by_angle * v + mean.sine_by_angle * quarter_turn(v));
  F.block<2, 2>(kVelocity, kVelocity) = turn(angle_rad);
  F.block<2, 1>(kVelocity, kAngularVelocity) = dt_s * quarter_turn(turn(angle_rad) * v);
}

Matrix8d jacobian(const Vector8d& x, double dt_s, const Eigen::Vector2d& by_psi, Course course) {
  Matrix8d F = Matrix8d::Identity();
  F.block<2, 2>(kPosition, kVelocity) = dt_s * Eigen::Matrix2d::Identity();
  if (course == Course::kTurning) turn_course(x, dt_s, F);
  F.block<2, 2>(kAxis, kAxis) = turn(2.0 * dt_s * x(kAngularVelocity));
  F.block<2, 1>(kAxis, kAngularVelocity) = dt_s * by_psi;
  return F;
}

Matrix8d added_covariance(double dt_s, const ProcessNoise& noise, const Eigen::Vector2d& by_psi) {
  const double dt2 = dt_s * dt_s / 2.0;
  const double dt3 = dt_s * dt_s * dt_s / 3.0;
  Matrix8d Q = Matrix8d::Zero();
  const double q_a = noise.acceleration * noise.acceleration;
  const Eigen::Matrix2d I = Eigen::Matrix2d::Identity();
  Q.block<2, 2>(kPosition, kPosition) = (q_a * dt3 + noise.position * noise.position * dt_s) * I;
  Q.block<2, 2>(kPosition, kVelocity) = Q.block<2, 2>(kVelocity, kPosition) = q_a * dt2 * I;
  Q.block<2, 2>(kVelocity, kVelocity) = q_a * dt_s * I;

  const double q_w = noise.angular_acceleration * noise.angular_acceleration;
  Q(kAngularVelocity, kAngularVelocity) = q_w * dt_s;
  Q.block<2, 1>(kAxis, kAngularVelocity) = q_w * dt2 * by_psi;
  Q.block<1, 2>(kAngularVelocity, kAxis) = q_w * dt2 * by_psi.transpose();
  Q.block<2, 2>(kAxis, kAxis) = q_w * dt3 * by_psi * by_psi.transpose();
  Q.block<2, 2>(kAxis, kAxis) += noise.radius_difference * noise.radius_difference * dt_s * I;
  Q(kShape, kShape) = noise.mean_radius * noise.mean_radius * dt_s;
  return Q;
}

/// Uncertainty of the rotation within `dt_s`.
double turn_sigma_rad(const ObjectEstimate& estimate, double dt_s, const ProcessNoise& noise) {
  const double q_w = noise.angular_acceleration * noise.angular_acceleration;
  return dt_s * std::sqrt(estimate.P(kAngularVelocity, kAngularVelocity) + q_w * dt_s / 3.0);
}

/// The world in the level frame: of positions, and of (p, q), which turn twice as far.
struct MeasuringFrame {
  explicit MeasuringFrame(const Pose2& T_world_level)
      : R_level_world(T_world_level.rotation().transpose()),
        world_level_m(-(R_level_world * T_world_level.translation_m)),
        axis_turn(turn(-2.0 * T_world_level.yaw_rad)) {}

  Vector5d measure(const Vector8d& x, double offset_s) const {
    Vector5d z;
    z.head<2>() =
        R_level_world * Eigen::Vector2d(x.segment<2>(kPosition) + offset_s * x.segment<2>(kVelocity)) + world_level_m;
    z(2) = x(kShape);
    z.tail<2>() = axis_turn * x.segment<2>(kAxis);
    return z;
  }

  Matrix58d jacobian(double offset_s) const {
    Matrix58d H = Matrix58d::Zero();
    H.block<2, 2>(0, kPosition) = R_level_world;
    H.block<2, 2>(0, kVelocity) = offset_s * R_level_world;
    H(2, kShape) = 1.0;
    H.block<2, 2>(3, kAxis) = axis_turn;
    return H;
  }

  /// Of what is measured as `z`.
  Matrix53d input_jacobian(const Vector5d& z) const {
    Matrix53d H_u = Matrix53d::Zero();
    H_u.topLeftCorner<2, 2>() = -R_level_world;
    H_u.block<2, 1>(0, 2) = -quarter_turn(z.head<2>());
    H_u.block<2, 1>(3, 2) = -2.0 * quarter_turn(z.tail<2>());
    return H_u;
  }

  Eigen::Matrix2d R_level_world;
  Eigen::Vector2d world_level_m;
  Eigen::Matrix2d axis_turn;
};

/// Covariance of the measurement noise and of the robot input, of what is expected as `z`.
Matrix5d noise_covariance(const MeasuringFrame& level, const Vector5d& z, const Measurement& measurement,
                          const Eigen::Matrix3d& U) {
  const Matrix53d H_u = level.input_jacobian(z);
  return measurement.R + H_u * U * H_u.transpose();
}

}  // namespace

Vector8d predict(const Vector8d& x, double dt_s, Course course) {
  Vector8d result = x;
  const double angle_rad = dt_s * x(kAngularVelocity);
  const Eigen::Vector2d v = x.segment<2>(kVelocity);
  if (course == Course::kTurning) {
    const MeanTurn mean = mean_turn(angle_rad);
    result.segment<2>(kPosition) += dt_s * (mean.cosine * v + mean.sine * quarter_turn(v));
    result.segment<2>(kVelocity) = turn(angle_rad) * v;
  } else {
    result.segment<2>(kPosition) += dt_s * v;
  }
  result.segment<2>(kAxis) = turn(2.0 * angle_rad) * x.segment<2>(kAxis);
  return result;
}

Matrix8d process_jacobian(const Vector8d& x, double dt_s, Course course) {
  return jacobian(x, dt_s, axis_by_psi(x, dt_s), course);
}

Matrix8d process_covariance(const Vector8d& x, double dt_s, const ProcessNoise& noise) {
  return added_covariance(dt_s, noise, axis_by_psi(x, dt_s));
}

void predict(ObjectEstimate& estimate, double dt_s, const ProcessNoise& noise, Course course) {
  Eigen::Vector2d by_psi = axis_by_psi(estimate.x, dt_s);
  const double sigma_rad = turn_sigma_rad(estimate, dt_s, noise);
  if (sigma_rad > kAnyTurn_rad) by_psi *= kAnyTurn_rad / sigma_rad;
  predict(estimate, predict(estimate.x, dt_s, course), jacobian(estimate.x, dt_s, by_psi, course),
          added_covariance(dt_s, noise, by_psi));
}

Measurement measurement_of(const Detection& detection) {
  Measurement result;
  result.z = smooth_parameters(detection.ellipse_level);
  result.R = detection.covariance;
  result.hidden_end = detection.hidden_end;
  result.is_box = detection.shape == Shape::kBox;
  result.middle_level_m = detection.middle_level_m;
  result.time_offset_s = detection.time_offset_s;
  return result;
}

Matrix8d state_covariance(const Matrix5d& R, const Pose2& T_world_level) {
  const Matrix58d H = measurement_jacobian(T_world_level, 0.0);  // its rows are orthonormal: H^T is its pseudo-inverse
  return H.transpose() * R * H;
}

Vector5d measure(const Vector8d& x, const Pose2& T_world_level, double offset_s) {
  return MeasuringFrame(T_world_level).measure(x, offset_s);
}

Matrix58d measurement_jacobian(const Pose2& T_world_level, double offset_s) {
  return MeasuringFrame(T_world_level).jacobian(offset_s);
}

Matrix53d measurement_input_jacobian(const Vector8d& x, const Pose2& T_world_level, double offset_s) {
  const MeasuringFrame level(T_world_level);
  return level.input_jacobian(level.measure(x, offset_s));
}

Match match(const ObjectEstimate& estimate, const Pose2& T_world_level, const Measurement& measurement,
            const Eigen::Matrix3d& U) {
  const MeasuringFrame level(T_world_level);
  const Vector5d z = level.measure(estimate.x, measurement.time_offset_s);
  return innovation(estimate, Vector5d(measurement.z - z), level.jacobian(measurement.time_offset_s),
                    noise_covariance(level, z, measurement, U));
}

void update(ObjectEstimate& estimate, const Pose2& T_world_level, const Measurement& measurement, const Match& match,
            const Eigen::Matrix3d& U) {
  const MeasuringFrame level(T_world_level);
  const Vector5d z = level.measure(estimate.x, measurement.time_offset_s);
  update(estimate, match, level.jacobian(measurement.time_offset_s), noise_covariance(level, z, measurement, U));
}

void bound_radii(Vector8d& x, double min_radius_m) {
  x(kShape) = std::max(x(kShape), min_radius_m);
  const double half_difference = x.segment<2>(kAxis).norm();
  const double most = x(kShape) - min_radius_m;
  if (half_difference > most) x.segment<2>(kAxis) *= most / half_difference;
}

ObjectEstimate map_measurement(const Measurement& measurement, const Pose2& T_world_level, const Eigen::Matrix3d& U) {
  ObjectEstimate estimate;
  estimate.x.segment<2>(kPosition) = T_world_level * Eigen::Vector2d(measurement.z.head<2>());
  estimate.x(kShape) = measurement.z(2);
  estimate.x.segment<2>(kAxis) = turn(2.0 * T_world_level.yaw_rad) * measurement.z.tail<2>();
  const Matrix53d H_u = measurement_input_jacobian(estimate.x, T_world_level, 0.0);  // at rest, any offset
  estimate.P = state_covariance(measurement.R + H_u * U * H_u.transpose(), T_world_level);
  return estimate;
}

void make_circle(ObjectEstimate& estimate) {
  Eigen::Matrix<double, 2, 8> H = Eigen::Matrix<double, 2, 8>::Zero();
  H.middleCols<2>(kAxis).setIdentity();
  const Eigen::Matrix2d R = Eigen::Matrix2d::Zero();
  update(estimate, innovation(estimate, Eigen::Vector2d(-estimate.x.segment<2>(kAxis)), H, R), H, R);
  // Exactly, without rounding errors: no measurement then changes them.
  estimate.x.segment<2>(kAxis).setZero();
  estimate.P.middleRows<2>(kAxis).setZero();
  estimate.P.middleCols<2>(kAxis).setZero();
}

Ellipse ellipse_world(const Vector8d& x) {
  Vector5d smooth;
  smooth << x.segment<2>(kPosition), x.segment<3>(kShape);
  return ellipse_from_smooth_parameters(smooth);
}

void fill_object(const ObjectEstimate& estimate, const Matrix8d& P_repeated, Object& object) {
  // The length of (p, q) is biased: errors across it increase it, errors along it cancel on average. E |a + e| = |a| +
  // P_across / (2 |a|) to second order, which is inverted here.
  const Eigen::Vector2d axis = estimate.x.segment<2>(kAxis);
  Vector8d x = estimate.x;
  if (axis.squaredNorm() > 0.0) {
    const Eigen::Vector2d across = quarter_turn(axis.normalized());
    const double across_variance = across.dot(estimate.P.block<2, 2>(kAxis, kAxis) * across);
    x.segment<2>(kAxis) *= std::sqrt(std::clamp(1.0 - across_variance / axis.squaredNorm(), 0.0, 1.0));
  }
  object.ellipse_world = ellipse_world(x);
  object.velocity_world_m_s = estimate.x.segment<2>(kVelocity);
  object.angular_velocity_rad_s = estimate.x(kAngularVelocity);

  Matrix8d J = Matrix8d::Zero();
  J.block<2, 2>(object_error::kPosition, kPosition).setIdentity();
  J.block<2, 2>(object_error::kVelocity, kVelocity).setIdentity();
  J(object_error::kAngularVelocity, kAngularVelocity) = 1.0;
  J.block<1, 3>(object_error::kOrientation, kShape) = psi_jacobian(object.ellipse_world);
  J.block<2, 3>(object_error::kRadii, kShape) = radii_jacobian(object.ellipse_world);
  const Matrix8d P = estimate.P + P_repeated;
  object.covariance = J * P * J.transpose();

  const Eigen::Matrix2d P_axis = P.block<2, 2>(kAxis, kAxis);
  constexpr double kChiSquare99 = 9.2103;  // of 2 degrees of freedom
  // det(P) d^2 by Cramer's rule, which is also valid for a circle's P of zero.
  const double scaled_distance2 = axis.x() * (P_axis(1, 1) * axis.x() - P_axis(0, 1) * axis.y()) +
                                  axis.y() * (P_axis(0, 0) * axis.y() - P_axis(1, 0) * axis.x());
  const bool may_be_circle = scaled_distance2 <= kChiSquare99 * P_axis.determinant();
  const double psi_variance = object.covariance(object_error::kOrientation, object_error::kOrientation);
  if (may_be_circle || psi_variance > kUniformAxisVariance) {
    object.covariance.row(object_error::kOrientation).setZero();
    object.covariance.col(object_error::kOrientation).setZero();
    object.covariance(object_error::kOrientation, object_error::kOrientation) = kUniformAxisVariance;
  }
  object.covariance = 0.5 * (object.covariance + object.covariance.transpose()).eval();
}

}  // namespace situation_awareness

// SPDX-License-Identifier: BSD-3-Clause
#include "situation_awareness/map/objects/object_filter.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>

#include <Eigen/LU>

#include "situation_awareness/geometry/angles.hpp"
#include "situation_awareness/map/objects/rates.hpp"

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

/// s. The time between two scans: the bound may matter within it.
constexpr double kShortStep_s = 0.05;

/// Below it the integrals of a turn are series, whose first terms left out are of its fourth power.
constexpr double kSmallTurn_rad = 1e-3;

/// d(p, q) / d(psi) after (p, q) turned by `axis_turn`.
Eigen::Vector2d axis_by_psi(const Vector8d& x, const Eigen::Matrix2d& axis_turn) {
  return 2.0 * quarter_turn(axis_turn * x.segment<2>(kAxis));
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

/// State after `dt_s`, in which (p, q) turn by `axis_turn`.
Vector8d predicted(const Vector8d& x, double dt_s, Course course, const Eigen::Matrix2d& axis_turn) {
  Vector8d result = x;
  const Eigen::Vector2d v = x.segment<2>(kVelocity);
  if (course == Course::kTurning) {
    const double angle_rad = dt_s * x(kAngularVelocity);
    const MeanTurn mean = mean_turn(angle_rad);
    result.segment<2>(kPosition) += dt_s * (mean.cosine * v + mean.sine * quarter_turn(v));
    result.segment<2>(kVelocity) = turn(angle_rad) * v;
  } else {
    result.segment<2>(kPosition) += dt_s * v;
  }
  result.segment<2>(kAxis) = axis_turn * x.segment<2>(kAxis);
  return result;
}

/// F P F^T on a straight course, without the zeros of F: in the order of their sums, so that each bit is the same.
Matrix8d transformed_straight(const Matrix8d& P, double dt_s, const Eigen::Matrix2d& axis_turn,
                              const Eigen::Vector2d& by_psi) {
  const Eigen::Vector2d b = dt_s * by_psi;
  const Eigen::Matrix2d& T = axis_turn;
  Matrix8d FP = P;
  for (int c = 0; c < 8; ++c) {
    FP(kPosition, c) = P(kPosition, c) + dt_s * P(kVelocity, c);
    FP(kPosition + 1, c) = P(kPosition + 1, c) + dt_s * P(kVelocity + 1, c);
    const double w = P(kAngularVelocity, c);
    const double p = P(kAxis, c);
    const double q = P(kAxis + 1, c);
    FP(kAxis, c) = b(0) * w + T(0, 0) * p + T(0, 1) * q;
    FP(kAxis + 1, c) = b(1) * w + T(1, 0) * p + T(1, 1) * q;
  }
  Matrix8d result = FP;
  result.col(kPosition) += FP.col(kVelocity) * dt_s;
  result.col(kPosition + 1) += FP.col(kVelocity + 1) * dt_s;
  const auto w = FP.col(kAngularVelocity);
  const auto p = FP.col(kAxis);
  const auto q = FP.col(kAxis + 1);
  result.col(kAxis) = w * b(0) + p * T(0, 0) + q * T(0, 1);
  result.col(kAxis + 1) = w * b(1) + p * T(1, 0) + q * T(1, 1);
  return result;
}

/// P + Q.
void add_process_covariance(double dt_s, const ProcessNoise& noise, const Eigen::Vector2d& by_psi, Matrix8d& P) {
  const double dt2 = dt_s * dt_s / 2.0;
  const double dt3 = dt_s * dt_s * dt_s / 3.0;
  const double q_a = noise.acceleration * noise.acceleration;
  const double position = q_a * dt3 + noise.position * noise.position * dt_s;
  for (int i = 0; i < 2; ++i) {
    P(kPosition + i, kPosition + i) += position;
    P(kPosition + i, kVelocity + i) += q_a * dt2;
    P(kVelocity + i, kPosition + i) += q_a * dt2;
    P(kVelocity + i, kVelocity + i) += q_a * dt_s;
  }

  const double q_w = noise.angular_acceleration * noise.angular_acceleration;
  P(kAngularVelocity, kAngularVelocity) += q_w * dt_s;
  P.block<2, 1>(kAxis, kAngularVelocity) += q_w * dt2 * by_psi;
  P.block<1, 2>(kAngularVelocity, kAxis) += q_w * dt2 * by_psi.transpose();
  Eigen::Matrix2d axis = q_w * dt3 * by_psi * by_psi.transpose();
  axis.diagonal().array() += noise.radius_difference * noise.radius_difference * dt_s;
  P.block<2, 2>(kAxis, kAxis) += axis;
  P(kShape, kShape) += noise.mean_radius * noise.mean_radius * dt_s;
}

/// Uncertainty of the rotation within `dt_s`.
double turn_sigma_rad(const ObjectEstimate& estimate, double dt_s, const ProcessNoise& noise) {
  const double q_w = noise.angular_acceleration * noise.angular_acceleration;
  return dt_s * std::sqrt(estimate.P(kAngularVelocity, kAngularVelocity) + q_w * dt_s / 3.0);
}

/// Covariance of the measurement noise and of the robot input, of what is expected as `z`.
Matrix5d noise_covariance(const MeasuringFrame& level, const Vector5d& z, const Measurement& measurement,
                          const Eigen::Matrix3d& U) {
  const Matrix53d H_u = level.input_jacobian(z);
  return measurement.R + H_u * U * H_u.transpose();
}

/// H P H^T without the zeros of H: the sums of the lower triangle in the order of the full products, so that each bit
/// is the same.
Matrix5d measured_covariance(const MeasuringFrame& level, const Matrix8d& P, double offset_s) {
  const Eigen::Matrix2d& R = level.R_level_world;
  const Eigen::Matrix2d R_offset = offset_s * R;
  const Eigen::Matrix2d& T = level.axis_turn;
  // Columns of H P that count.
  const auto measured = [&](int c) {
    Vector5d column;
    for (int r = 0; r < 2; ++r) {
      column(r) = ((R(r, 0) * P(0, c) + R(r, 1) * P(1, c)) + R_offset(r, 0) * P(2, c)) + R_offset(r, 1) * P(3, c);
      column(3 + r) = T(r, 0) * P(kAxis, c) + T(r, 1) * P(kAxis + 1, c);
    }
    column(2) = P(kShape, c);
    return column;
  };
  const Vector5d x = measured(0), y = measured(1), vx = measured(2), vy = measured(3);
  const Vector5d p = measured(kAxis), q = measured(kAxis + 1);
  Matrix5d S;
  for (int c = 0; c < 2; ++c) {
    for (int r = 0; r < 4; ++r) {
      S(r, c) = ((x(r) * R(c, 0) + y(r) * R(c, 1)) + vx(r) * R_offset(c, 0)) + vy(r) * R_offset(c, 1);
    }
    S(4, c) = (x(4) * R(c, 0) + y(4) * R(c, 1)) + (vx(4) * R_offset(c, 0) + vy(4) * R_offset(c, 1));
    S.col(3 + c) = p * T(c, 0) + q * T(c, 1);
  }
  S.col(2) = measured(kShape);
  return S;
}

/// J P J^T, the covariance of the error state (object_error), J the Jacobian of that by the state.
Matrix8d of_error_state(const Matrix8d& P, const Eigen::RowVector3d& by_psi,
                        const Eigen::Matrix<double, 2, 3>& by_radii) {
  const auto shape_product = [](const auto& j, const auto& m, const auto& p, const auto& q) {
    return (j(0) * m + j(1) * p) + j(2) * q;
  };
  Matrix8d JP;
  for (int c = 0; c < 8; ++c) {
    const double m = P(kShape, c);
    const double p = P(kAxis, c);
    const double q = P(kAxis + 1, c);
    JP.col(c).head<4>() = P.col(c).head<4>();
    JP(object_error::kOrientation, c) = shape_product(by_psi, m, p, q);
    JP(object_error::kAngularVelocity, c) = P(kAngularVelocity, c);
    JP(object_error::kRadii, c) = shape_product(by_radii.row(0), m, p, q);
    JP(object_error::kRadii + 1, c) = shape_product(by_radii.row(1), m, p, q);
  }
  Matrix8d result;
  result.leftCols<4>() = JP.leftCols<4>();
  result.col(object_error::kAngularVelocity) = JP.col(kAngularVelocity);
  for (int r = 0; r < 8; ++r) {
    const double m = JP(r, kShape);
    const double p = JP(r, kAxis);
    const double q = JP(r, kAxis + 1);
    result(r, object_error::kOrientation) = shape_product(by_psi, m, p, q);
    result(r, object_error::kRadii) = shape_product(by_radii.row(0), m, p, q);
    result(r, object_error::kRadii + 1) = shape_product(by_radii.row(1), m, p, q);
  }
  return result;
}

/// As solve_cholesky(), written out, with which the update of 60 objects takes a tenth less (pipeline_speed): X with
/// L L^T X = B.
template <int Columns>
Eigen::Matrix<double, 5, Columns> solve(const Matrix5d& L, const Eigen::Matrix<double, 5, Columns>& B) {
  Eigen::Matrix<double, 5, Columns> X = B;
  Vector5d inverse;
  for (int i = 0; i < 5; ++i) inverse(i) = 1.0 / L(i, i);
  for (int c = 0; c < Columns; ++c) {
    double x0 = X(0, c), x1 = X(1, c), x2 = X(2, c), x3 = X(3, c), x4 = X(4, c);
    x0 *= inverse(0);
    x1 = (x1 - x0 * L(1, 0)) * inverse(1);
    x2 = ((x2 - x0 * L(2, 0)) - x1 * L(2, 1)) * inverse(2);
    x3 = (((x3 - x0 * L(3, 0)) - x1 * L(3, 1)) - x2 * L(3, 2)) * inverse(3);
    x4 = (x4 - (((L(4, 0) * x0 + L(4, 1) * x1) + L(4, 2) * x2) + L(4, 3) * x3)) * inverse(4);
    x4 *= inverse(4);
    x3 = (x3 - L(4, 3) * x4) * inverse(3);
    x2 = (x2 - (L(3, 2) * x3 + L(4, 2) * x4)) * inverse(2);
    x1 = (x1 - ((L(2, 1) * x2 + L(3, 1) * x3) + L(4, 1) * x4)) * inverse(1);
    x0 = (x0 - (((L(1, 0) * x1 + L(2, 0) * x2) + L(3, 0) * x3) + L(4, 0) * x4)) * inverse(0);
    X.col(c) << x0, x1, x2, x3, x4;
  }
  return X;
}

/// Rows of the state that are not zero in the covariance of what stands.
constexpr std::array<int, 5> kPlaceAndShape{kPosition, kPosition + 1, kShape, kAxis, kAxis + 1};

/// A B, each sum in the order of the columns of A.
Matrix5d product(const Matrix5d& A, const Matrix5d& B) {
  Matrix5d AB;
  for (int c = 0; c < 5; ++c) {
    Vector5d sum = A.col(0) * B(0, c);
    for (int k = 1; k < 5; ++k) sum += A.col(k) * B(k, c);
    AB.col(c) = sum;
  }
  return AB;
}

/// A P A^T.
Matrix5d transformed_in_order(const Matrix5d& A, const Matrix5d& P) { return product(product(A, P), A.transpose()); }

/// The update of what stands, without the zeros of P either.
void correct_standing(ObjectEstimate& estimate, const Match& match, const MeasuringFrame& level, const Matrix5d& L,
                      const Eigen::Matrix<double, 5, 8>& HP, const Matrix5d& R) {
  const Eigen::Matrix2d& A = level.R_level_world;
  const Eigen::Matrix2d& T = level.axis_turn;
  Matrix5d HP_of_five, P;
  for (int c = 0; c < 5; ++c) {
    const int column = kPlaceAndShape[static_cast<std::size_t>(c)];
    HP_of_five.col(c) = HP.col(column);
    for (int r = 0; r < 5; ++r) P(r, c) = estimate.P(kPlaceAndShape[static_cast<std::size_t>(r)], column);
  }
  const Matrix5d K = solve(L, HP_of_five).transpose();
  Matrix5d I_KH = Matrix5d::Identity();
  for (int c = 0; c < 2; ++c) {
    I_KH.col(c) -= K.col(0) * A(0, c) + K.col(1) * A(1, c);
    I_KH.col(3 + c) -= K.col(3) * T(0, c) + K.col(4) * T(1, c);
  }
  I_KH.col(2) -= K.col(2);
  const Matrix5d sum = transformed_in_order(I_KH, P) + transformed_in_order(K, R);
  const Matrix5d corrected = 0.5 * (sum + sum.transpose());
  Vector5d e = K.col(0) * match.nu(0);
  for (int k = 1; k < 5; ++k) e += K.col(k) * match.nu(k);
  for (int c = 0; c < 5; ++c) {
    const int column = kPlaceAndShape[static_cast<std::size_t>(c)];
    estimate.x(column) += e(c);
    for (int r = 0; r < 5; ++r) estimate.P(kPlaceAndShape[static_cast<std::size_t>(r)], column) = corrected(r, c);
  }
}

/// The update of the filter (estimation/error_state_filter.hpp) without the zeros of H.
void correct(ObjectEstimate& estimate, const Match& match, const MeasuringFrame& level, double offset_s,
             const Matrix5d& R) {
  const Eigen::Matrix2d& A = level.R_level_world;
  const Eigen::Matrix2d A_offset = offset_s * A;
  const Eigen::Matrix2d& T = level.axis_turn;
  const Matrix8d& P = estimate.P;
  Eigen::Matrix<double, 5, 8> HP;
  for (int c = 0; c < 8; ++c) {
    for (int r = 0; r < 2; ++r) {
      HP(r, c) = ((A(r, 0) * P(0, c) + A(r, 1) * P(1, c)) + A_offset(r, 0) * P(2, c)) + A_offset(r, 1) * P(3, c);
      HP(3 + r, c) = T(r, 0) * P(kAxis, c) + T(r, 1) * P(kAxis + 1, c);
    }
    HP(2, c) = P(kShape, c);
  }
  Matrix5d L;
  if (!cholesky(match.S, L)) L.setConstant(std::numeric_limits<double>::quiet_NaN());
  if (has_no_rates(estimate)) return correct_standing(estimate, match, level, L, HP, R);
  const Eigen::Matrix<double, 8, 5> K = solve(L, HP).transpose();
  Matrix8d I_KH = Matrix8d::Identity();
  for (int c = 0; c < 2; ++c) {
    I_KH.col(kPosition + c) -= K.col(0) * A(0, c) + K.col(1) * A(1, c);
    I_KH.col(kVelocity + c) -= K.col(0) * A_offset(0, c) + K.col(1) * A_offset(1, c);
    I_KH.col(kAxis + c) -= K.col(3) * T(0, c) + K.col(4) * T(1, c);
  }
  I_KH.col(kShape) -= K.col(2);
  const Matrix8d corrected = transformed(I_KH, P) + transformed(K, R);
  estimate.P = 0.5 * (corrected + corrected.transpose());
  estimate.x += K * match.nu;
}

}  // namespace

Vector8d predict(const Vector8d& x, double dt_s, Course course) {
  return predicted(x, dt_s, course, turn(2.0 * dt_s * x(kAngularVelocity)));
}

Matrix8d process_jacobian(const Vector8d& x, double dt_s, Course course) {
  const Eigen::Matrix2d axis_turn = turn(2.0 * dt_s * x(kAngularVelocity));
  Matrix8d F = Matrix8d::Identity();
  F.block<2, 2>(kPosition, kVelocity) = dt_s * Eigen::Matrix2d::Identity();
  if (course == Course::kTurning) turn_course(x, dt_s, F);
  F.block<2, 2>(kAxis, kAxis) = axis_turn;
  F.block<2, 1>(kAxis, kAngularVelocity) = dt_s * axis_by_psi(x, axis_turn);
  return F;
}

Matrix8d process_covariance(const Vector8d& x, double dt_s, const ProcessNoise& noise) {
  Matrix8d Q = Matrix8d::Zero();
  add_process_covariance(dt_s, noise, axis_by_psi(x, turn(2.0 * dt_s * x(kAngularVelocity))), Q);
  return Q;
}

void predict(ObjectEstimate& estimate, double dt_s, const ProcessNoise& noise, Course course) {
  const Eigen::Matrix2d axis_turn = turn(2.0 * dt_s * estimate.x(kAngularVelocity));
  Eigen::Vector2d by_psi = axis_by_psi(estimate.x, axis_turn);
  const double sigma_rad = turn_sigma_rad(estimate, dt_s, noise);
  if (sigma_rad > kAnyTurn_rad) by_psi *= kAnyTurn_rad / sigma_rad;
  Matrix8d P;
  if (course == Course::kTurning) {
    Matrix8d F = Matrix8d::Identity();
    turn_course(estimate.x, dt_s, F);
    F.block<2, 2>(kAxis, kAxis) = axis_turn;
    F.block<2, 1>(kAxis, kAngularVelocity) = dt_s * by_psi;
    P = transformed(F, estimate.P);
  } else {
    P = transformed_straight(estimate.P, dt_s, axis_turn, by_psi);
  }
  add_process_covariance(dt_s, noise, by_psi, P);
  estimate.P = 0.5 * (P + P.transpose());
  estimate.x = predicted(estimate.x, dt_s, course, axis_turn);
}

double longest_step_s(const ObjectEstimate& estimate, double dt_s, const ProcessNoise& noise) {
  double step_s = dt_s;
  while (step_s > kShortStep_s && turn_sigma_rad(estimate, step_s, noise) > kAnyTurn_rad) step_s *= 0.5;
  return step_s;
}

MeasuringFrame::MeasuringFrame(const Pose2& T_world_level)
    : R_level_world(T_world_level.rotation().transpose()),
      world_level_m(-(R_level_world * T_world_level.translation_m)),
      axis_turn(turn(-2.0 * T_world_level.yaw_rad)) {}

Vector5d MeasuringFrame::measure(const Vector8d& x, double offset_s) const {
  Vector5d z;
  z.head<2>() =
      R_level_world * Eigen::Vector2d(x.segment<2>(kPosition) + offset_s * x.segment<2>(kVelocity)) + world_level_m;
  z(2) = x(kShape);
  z.tail<2>() = axis_turn * x.segment<2>(kAxis);
  return z;
}

Matrix58d MeasuringFrame::jacobian(double offset_s) const {
  Matrix58d H = Matrix58d::Zero();
  H.block<2, 2>(0, kPosition) = R_level_world;
  H.block<2, 2>(0, kVelocity) = offset_s * R_level_world;
  H(2, kShape) = 1.0;
  H.block<2, 2>(3, kAxis) = axis_turn;
  return H;
}

Matrix53d MeasuringFrame::input_jacobian(const Vector5d& z) const {
  Matrix53d H_u = Matrix53d::Zero();
  H_u.topLeftCorner<2, 2>() = -R_level_world;
  H_u.block<2, 1>(0, 2) = -quarter_turn(z.head<2>());
  H_u.block<2, 1>(3, 2) = -2.0 * quarter_turn(z.tail<2>());
  return H_u;
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

Matrix8d state_covariance(const Matrix5d& R, const MeasuringFrame& level) {
  // H^T R H: the rows of H are orthonormal, so that H^T is its pseudo-inverse.
  const Eigen::Matrix2d& A = level.R_level_world;
  const Eigen::Matrix2d& T = level.axis_turn;
  Eigen::Matrix<double, 5, 5> M;  // rows of H^T R that are not zero
  for (int r = 0; r < 2; ++r) {
    M.row(r) = A(0, r) * R.row(0) + A(1, r) * R.row(1);
    M.row(3 + r) = T(0, r) * R.row(3) + T(1, r) * R.row(4);
  }
  M.row(2) = R.row(2);
  Matrix5d MH;
  for (int c = 0; c < 2; ++c) {
    MH.col(c) = M.col(0) * A(0, c) + M.col(1) * A(1, c);
    MH.col(3 + c) = M.col(3) * T(0, c) + M.col(4) * T(1, c);
  }
  MH.col(2) = M.col(2);
  Matrix8d result = Matrix8d::Zero();
  result.block<2, 2>(kPosition, kPosition) = MH.topLeftCorner<2, 2>();
  result.block<2, 3>(kPosition, kShape) = MH.topRightCorner<2, 3>();
  result.block<3, 2>(kShape, kPosition) = MH.bottomLeftCorner<3, 2>();
  result.block<3, 3>(kShape, kShape) = MH.bottomRightCorner<3, 3>();
  return result;
}

Matrix8d state_covariance(const Matrix5d& R, const Pose2& T_world_level) {
  return state_covariance(R, MeasuringFrame(T_world_level));
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

Match match(const ObjectEstimate& estimate, const MeasuringFrame& level, const Measurement& measurement,
            const Eigen::Matrix3d& U) {
  const Vector5d z = level.measure(estimate.x, measurement.time_offset_s);
  const Matrix5d S =
      measured_covariance(level, estimate.P, measurement.time_offset_s) + noise_covariance(level, z, measurement, U);
  return innovation(Vector5d(measurement.z - z), S);
}

Match match(const ObjectEstimate& estimate, const Pose2& T_world_level, const Measurement& measurement,
            const Eigen::Matrix3d& U) {
  return match(estimate, MeasuringFrame(T_world_level), measurement, U);
}

void update(ObjectEstimate& estimate, const MeasuringFrame& level, const Measurement& measurement, const Match& match,
            const Eigen::Matrix3d& U) {
  const Vector5d z = level.measure(estimate.x, measurement.time_offset_s);
  correct(estimate, match, level, measurement.time_offset_s, noise_covariance(level, z, measurement, U));
}

void update(ObjectEstimate& estimate, const Pose2& T_world_level, const Measurement& measurement, const Match& match,
            const Eigen::Matrix3d& U) {
  update(estimate, MeasuringFrame(T_world_level), measurement, match, U);
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

  const Matrix8d P = estimate.P + P_repeated;
  object.covariance = of_error_state(P, psi_jacobian(object.ellipse_world), radii_jacobian(object.ellipse_world));

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

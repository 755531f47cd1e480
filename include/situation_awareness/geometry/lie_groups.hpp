// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cmath>

#include <Eigen/Core>
#include <Eigen/Geometry>

#include "situation_awareness/geometry/angles.hpp"
#include "situation_awareness/geometry/pose2.hpp"

namespace situation_awareness {

// The rigid motions SE(2) and the rotations SO(3) as Lie groups (Sola, Deray and Atchuthan, "A micro Lie theory for
// state estimation in robotics", 2018). A tangent vector is given in the moving frame: x exp(tau) is the pose reached
// from x in unit time at the constant velocity tau in its own frame.
//
//   symbol  meaning                                            space     size
//   tau     tangent vector of SE(2): (rho, theta), m and rad   R^3       3
//   phi     tangent vector of SO(3): axis times angle, rad     R^3       3
//   Ad      adjoint: T exp(tau) = exp(Ad tau) T                J         3x3
//   J_r     right Jacobian: exp(tau + d) = exp(tau) exp(J_r d) to first order in d    3x3

// Factors of the series below; finite, and exact to rounding, at zero too.

/// sin(a) / a
inline double sinc(double a) { return std::abs(a) < 1e-8 ? 1.0 : std::sin(a) / a; }

/// (1 - cos(a)) / a^2
inline double one_minus_cos_over_square(double a) {
  const double half = sinc(0.5 * a);
  return 0.5 * half * half;
}

/// (a - sin(a)) / a^3
inline double angle_minus_sin_over_cube(double a) {
  const double a2 = a * a;
  if (a2 < 1e-2) return (1.0 - a2 / 20.0 * (1.0 - a2 / 42.0 * (1.0 - a2 / 72.0))) / 6.0;
  return (a - std::sin(a)) / (a2 * a);
}

// --- SE(2)
// ------------------------------------------------------------------------------------------------------------

/// The motion along an arc of length |rho| that turns by theta; its yaw is theta, not wrapped.
inline Pose2 exp_se2(const Eigen::Vector3d& tau) {
  const double theta = tau(2);
  const double along = sinc(theta);
  const double across = theta * one_minus_cos_over_square(theta);  // (1 - cos(theta)) / theta
  return {{along * tau(0) - across * tau(1), across * tau(0) + along * tau(1)}, theta};
}

/// The tangent vector of the shortest rotation, theta in [-pi, pi]: the inverse of exp_se2 in this range.
inline Eigen::Vector3d log_se2(const Pose2& T) {
  const double theta = wrap_to_pi(T.yaw_rad);
  const double along = sinc(theta);
  const double across = theta * one_minus_cos_over_square(theta);
  const double determinant = along * along + across * across;  // 4 / pi^2 at least, at half a turn
  const Eigen::Vector2d& t = T.translation_m;
  return {(along * t.x() + across * t.y()) / determinant, (along * t.y() - across * t.x()) / determinant, theta};
}

/// Ad of SE(2).
inline Eigen::Matrix3d adjoint_se2(const Pose2& T) {
  Eigen::Matrix3d Ad = Eigen::Matrix3d::Identity();
  Ad.topLeftCorner<2, 2>() = T.rotation();
  Ad(0, 2) = T.translation_m.y();
  Ad(1, 2) = -T.translation_m.x();
  return Ad;
}

/// J_r of SE(2).
inline Eigen::Matrix3d right_jacobian_se2(const Eigen::Vector3d& tau) {
  const double theta = tau(2);
  const double along = sinc(theta);
  const double across = theta * one_minus_cos_over_square(theta);
  const double c1 = theta * angle_minus_sin_over_cube(theta);  // (theta - sin(theta)) / theta^2
  const double c2 = one_minus_cos_over_square(theta);
  Eigen::Matrix3d J;
  J << along, across, c1 * tau(0) - c2 * tau(1),  //
      -across, along, c2 * tau(0) + c1 * tau(1),  //
      0.0, 0.0, 1.0;
  return J;
}

// --- SO(3)
// ------------------------------------------------------------------------------------------------------------

/// The matrix of the cross product: hat(a) b = a x b.
inline Eigen::Matrix3d hat(const Eigen::Vector3d& a) {
  Eigen::Matrix3d result;
  result << 0.0, -a.z(), a.y(), a.z(), 0.0, -a.x(), -a.y(), a.x(), 0.0;
  return result;
}

/// The rotation about the axis phi by its length.
inline Eigen::Quaterniond exp_so3(const Eigen::Vector3d& phi) {
  const double half = 0.5 * phi.norm();
  const Eigen::Vector3d vector = 0.5 * sinc(half) * phi;
  return {std::cos(half), vector.x(), vector.y(), vector.z()};
}

/// The axis times the angle, in [0, pi], of a rotation; q and -q are the same. q need not be of unit length.
inline Eigen::Vector3d log_so3(const Eigen::Quaterniond& q) {
  const double sine = q.vec().norm();
  if (sine == 0.0) return Eigen::Vector3d::Zero();
  const double half = std::atan2(sine, std::abs(q.w()));
  return (q.w() < 0.0 ? -2.0 : 2.0) * half / sine * q.vec();
}

/// J_r of SO(3).
inline Eigen::Matrix3d right_jacobian_so3(const Eigen::Vector3d& phi) {
  const double angle = phi.norm();
  const Eigen::Matrix3d across = hat(phi);
  return Eigen::Matrix3d::Identity() - one_minus_cos_over_square(angle) * across +
         angle_minus_sin_over_cube(angle) * across * across;
}

}  // namespace situation_awareness

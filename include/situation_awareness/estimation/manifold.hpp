// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <Eigen/Core>

#include "situation_awareness/geometry/lie_groups.hpp"
#include "situation_awareness/geometry/pose2.hpp"

namespace situation_awareness {

/// State space of an error-state filter: applies an error, a vector of R^n, to a state, and gives the error between two
/// states. A specialisation has
///
///     static constexpr int kDimension;         // n
///     static constexpr bool kFlat;             // errors are plain differences; see below
///     static State identity();                 // an initial state
///     static State retract(x, e);              // x [+] e, "boxplus": the state that e leads to from x
///     static Error local_coordinates(x, y);    // y [-] x, "boxminus": the error that leads from x to y
///     static Jacobian reset_jacobian(e);       // unless flat: d((x [+] d) [-] (x [+] e)) / d(d) at d = e
///
/// with `retract(x, local_coordinates(x, y)) = y` wherever a unique shortest path from x to y exists, and
/// `local_coordinates(x, retract(x, e)) = e` for every e of a shortest path. If the space is flat, x [+] e = x + e and
/// y [-] x = y - x in some coordinates: errors then do not depend on the state, reset_jacobian would be the identity
/// and is omitted, and the error-state (indirect) filter is the direct one.
///
/// Errors of rotations and poses are given in the moving frame: x [+] e = x exp(e).
template <class State>
struct Manifold;

template <class State>
using ErrorVector = Eigen::Matrix<double, Manifold<State>::kDimension, 1>;
template <class State>
using ErrorMatrix = Eigen::Matrix<double, Manifold<State>::kDimension, Manifold<State>::kDimension>;

/// R^n.
template <int Size>
struct Manifold<Eigen::Matrix<double, Size, 1>> {
  static constexpr int kDimension = Size;
  static constexpr bool kFlat = true;
  using Vector = Eigen::Matrix<double, Size, 1>;

  static Vector identity() { return Vector::Zero(); }
  static Vector retract(const Vector& x, const Vector& e) { return x + e; }
  static Vector local_coordinates(const Vector& x, const Vector& y) { return y - x; }
};

/// SE(2): the error is (forward, left, yaw) in m and rad, in the frame of the pose itself.
template <>
struct Manifold<Pose2> {
  static constexpr int kDimension = 3;
  static constexpr bool kFlat = false;

  static Pose2 identity() { return {}; }
  static Pose2 retract(const Pose2& T, const Eigen::Vector3d& e) { return T * exp_se2(e); }
  static Eigen::Vector3d local_coordinates(const Pose2& T, const Pose2& other) { return log_se2(inverse(T) * other); }
  static Eigen::Matrix3d reset_jacobian(const Eigen::Vector3d& e) { return right_jacobian_se2(e); }
};

}  // namespace situation_awareness

// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <Eigen/Core>

#include "situation_awareness/detections/detections.hpp"
#include "situation_awareness/estimation/error_state_filter.hpp"
#include "situation_awareness/geometry/ellipse.hpp"
#include "situation_awareness/geometry/pose2.hpp"
#include "situation_awareness/map/objects/objects.hpp"

namespace situation_awareness {

// The EKF of one element of the map under one motion (ellipse paper, Sect. V; circle paper, Sect. V-B).
//
//   symbol  meaning                                               space     size
//   x       state: t, v, w, s                                     R^8       8
//   t, v    position and velocity of the centre, in the world     R^2       2
//   w       angular velocity                                      R         1
//   s       shape: m = (rx + ry) / 2 and                          R^3       3
//           (p, q) = (rx - ry) / 2 (cos 2 psi, sin 2 psi)
//   P       covariance of the error of x                          R^8x8     8x8
//   u, U    robot input: pose of the level frame in the world     SE(2)     3, 3x3
//   z, R    measurement: centre and shape in the level frame      R^5       5, 5x5
//   nu, S   innovation and its covariance                         R^5       5, 5x5
//   F       d(x') / d(x) over a time step                         J_x_x     8x8
//   H       d(z) / d(x)                                           J_z_x     5x8
//   H_u     d(z) / d(u), u = (x, y in the world, yaw)             J_z_u     5x3
//
// The papers' state has psi, rx and ry in place of s. The two are equivalent, but s has no discontinuity at psi = +-90
// deg, describes each curve once, and is not overconfident in psi at a circle, and the measurement is linear in the
// state.
//
// The papers' filter is an indirect (error-state) one, since the error of an orientation is no plain difference. That
// of s is. x [+] e = x + e then holds for the whole state, there is nothing to reset, and the direct and the indirect
// filter are the same. This one is the indirect filter of estimation/ on the manifold R^8.

/// Index of each part in the filter's state.
namespace object_state {
constexpr int kPosition = 0;         ///< 2, m, world
constexpr int kVelocity = 2;         ///< 2, m/s, world
constexpr int kAngularVelocity = 4;  ///< 1, rad/s, about world z
constexpr int kShape = 5;            ///< 3, m: m, p, q, in the world
}  // namespace object_state

constexpr int kMeasurementSize = 5;  ///< of z

using Matrix58d = Eigen::Matrix<double, 5, 8>;
using Matrix53d = Eigen::Matrix<double, 5, 3>;

/// Mean and covariance of the filter's state.
using ObjectEstimate = Estimate<Vector8d>;
static_assert(Manifold<Vector8d>::kFlat, "every error is a plain difference: direct and indirect filter coincide");

/// Spectral densities of the white noises that drive the process model, and of the random walks.
struct ProcessNoise {
  double acceleration = 0.0;          ///< m/s^2/sqrt(Hz)
  double angular_acceleration = 0.0;  ///< rad/s^2/sqrt(Hz)
  double position = 0.0;              ///< m/sqrt(s)
  double mean_radius = 0.0;           ///< m/sqrt(s), of m
  double radius_difference = 0.0;     ///< m/sqrt(s), of p and q
};

/// How a velocity goes on: constant, or turning with the body as that of a vehicle (coordinated turn; Bar-Shalom, Li
/// and Kirubarajan, 2001, Sect. 11.7).
enum class Course { kStraight, kTurning };

/// State after `dt_s` (ellipse paper, eqs. 8 to 12): constant angular velocity and radii, and the velocity as by
/// `course`.
Vector8d predict(const Vector8d& x, double dt_s, Course course = Course::kStraight);

/// F of that step.
Matrix8d process_jacobian(const Vector8d& x, double dt_s, Course course = Course::kStraight);

/// Process noise of `dt_s`, integrated over continuous time, so that one long step equals many short ones (exactly so
/// without rotation). What a turn within the step changes of it is left out.
Matrix8d process_covariance(const Vector8d& x, double dt_s, const ProcessNoise& noise);

/// Predict state and covariance. The uncertainty of the orientation is bounded by that of an unknown axis.
void predict(ObjectEstimate& estimate, double dt_s, const ProcessNoise& noise, Course course = Course::kStraight);

/// The longest part of `dt_s`, halved as often as needed, over which that bound does not matter.
double longest_step_s(const ObjectEstimate& estimate, double dt_s, const ProcessNoise& noise);

/// Measurement of the ellipse by a detection.
struct Measurement {
  Vector5d z = Vector5d::Zero();  ///< smooth_parameters in the level frame
  Matrix5d R = Matrix5d::Identity();
  bool is_box = false;      ///< of a box
  bool hidden_end = false;  ///< an end of its segment is hidden: it may be part of anything
  /// Mean of the hits in the level frame, or NaN where it is not known.
  Eigen::Vector2d middle_level_m = Eigen::Vector2d::Constant(std::numeric_limits<double>::quiet_NaN());
  double time_offset_s = 0.0;  ///< time of the detection after the stamp of the scan
};

Measurement measurement_of(const Detection& detection);

/// The world in the level frame: of positions, and of (p, q), which turn twice as far. Made once for all elements and
/// detections of a scan.
struct MeasuringFrame {
  explicit MeasuringFrame(const Pose2& T_world_level);

  /// h(x).
  Vector5d measure(const Vector8d& x, double offset_s) const;
  /// H.
  Matrix58d jacobian(double offset_s) const;
  /// H_u of what is measured as `z`.
  Matrix53d input_jacobian(const Vector5d& z) const;

  Eigen::Matrix2d R_level_world;
  Eigen::Vector2d world_level_m;
  Eigen::Matrix2d axis_turn;
};

/// R in the coordinates of the state; zero for the velocities.
Matrix8d state_covariance(const Matrix5d& R, const Pose2& T_world_level);
Matrix8d state_covariance(const Matrix5d& R, const MeasuringFrame& level);

/// h(x): centre and shape in the level frame (ellipse paper, eqs. 13 to 15), `offset_s` after the time of x.
Vector5d measure(const Vector8d& x, const Pose2& T_world_level, double offset_s);

/// H depends only on the robot's heading and the offset.
Matrix58d measurement_jacobian(const Pose2& T_world_level, double offset_s);
/// H_u, at the element's position after the offset.
Matrix53d measurement_input_jacobian(const Vector8d& x, const Pose2& T_world_level, double offset_s);

/// Innovation of a measurement.
using Match = Innovation<kMeasurementSize>;

/// Compare an element with a measurement (circle paper, eqs. 24 to 26). `U` is the covariance of the robot input.
Match match(const ObjectEstimate& estimate, const Pose2& T_world_level, const Measurement& measurement,
            const Eigen::Matrix3d& U);
Match match(const ObjectEstimate& estimate, const MeasuringFrame& level, const Measurement& measurement,
            const Eigen::Matrix3d& U);

/// Correct state and covariance (circle paper, eqs. 27 to 30).
void update(ObjectEstimate& estimate, const Pose2& T_world_level, const Measurement& measurement, const Match& match,
            const Eigen::Matrix3d& U);
void update(ObjectEstimate& estimate, const MeasuringFrame& level, const Measurement& measurement, const Match& match,
            const Eigen::Matrix3d& U);

/// m. Lower bound of the radii. No test bounds it.
constexpr double kMinRadius_m = 0.01;
/// Keep both radii at or above `min_radius_m`.
void bound_radii(Vector8d& x, double min_radius_m);

/// g(z): a new element at rest, its velocities unknown (ellipse paper, eqs. 16 to 20); P of v and w is zero.
ObjectEstimate map_measurement(const Measurement& measurement, const Pose2& T_world_level, const Eigen::Matrix3d& U);

/// Condition the estimate on a circle: p = q = 0. Their correlations correct the other states; with P zero there, no
/// measurement changes p and q.
void make_circle(ObjectEstimate& estimate);

/// The ellipse in the world, rx >= ry.
Ellipse ellipse_world(const Vector8d& x);

/// The published mean and covariance, in position, velocity, psi, angular velocity and radii: sets ellipse, velocities
/// and covariance. The covariance, correlated errors included, is transformed by the Jacobian of (psi, rx, ry) by (m,
/// p, q). Where (p, q) does not differ from zero at 99 % confidence the ellipse may be a circle: psi is then unknown,
/// with the variance of a uniform axis. The difference of the radii is |(p, q)| without its bias.
void fill_object(const ObjectEstimate& estimate, const Matrix8d& P_repeated, Object& object);

}  // namespace situation_awareness

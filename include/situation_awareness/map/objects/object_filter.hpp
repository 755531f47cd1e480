// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <array>
#include <complex>

#include <Eigen/Core>

#include "situation_awareness/detections/detections.hpp"
#include "situation_awareness/geometry/ellipse.hpp"
#include "situation_awareness/geometry/pose2.hpp"
#include "situation_awareness/map/objects/objects.hpp"

namespace situation_awareness {

// The error-state EKF of one element of the map (ellipse paper, Sect. V; circle paper, Sect. V-B).
//
//   symbol  meaning                                              space          size
//   x       nominal state: t, v, q, w, r                         R^4 x S^1 x R^3   -
//   dx      error state: dt, dv, dtheta, dw, dr                  R^8            8
//   P       covariance of dx                                     R^8x8          8x8
//   u       robot input: pose of the level frame in the world    SE(2)          3
//   z       measurement: centre, psi, radii in the level frame   R^2 x S^1 x R^2   5
//   nu      innovation, psi wrapped                              R^5            5
//   F       d(dx') / d(dx) over a time step                      J_dx_dx        8x8
//   H       d(nu) / d(dx)                                        J_z_dx         5x8
//   H_u     d(nu) / d(du), du = (dt_x, dt_y in the world, dyaw)  J_z_du         5x3

using Matrix58d = Eigen::Matrix<double, 5, 8>;
using Matrix53d = Eigen::Matrix<double, 5, 3>;

/// Nominal state. The orientation is a unit complex number (cos psi + i sin psi): it has no seam, and its error is one
/// angle.
struct ObjectState {
  Eigen::Vector2d position_world_m = Eigen::Vector2d::Zero();
  Eigen::Vector2d velocity_world_m_s = Eigen::Vector2d::Zero();
  std::complex<double> orientation_world = 1.0;
  double angular_velocity_rad_s = 0.0;
  Eigen::Vector2d radii_m = Eigen::Vector2d::Zero();
};

/// x (+) dx (ellipse paper, eq. 2): the orientation turns by dtheta, everything else adds.
ObjectState boxplus(const ObjectState& x, const Vector8d& dx);

/// a (-) b, so that boxplus(b, boxminus(a, b)) is a; the turn is in [-pi, pi].
Vector8d boxminus(const ObjectState& a, const ObjectState& b);

/// Spectral densities of the white noises that drive the process model, and of the random walk of the radii.
struct ProcessNoise {
  double acceleration = 0.0;          ///< m/s^2/sqrt(Hz)
  double angular_acceleration = 0.0;  ///< rad/s^2/sqrt(Hz)
  double radius = 0.0;                ///< m/sqrt(s)
};

/// State after `dt_s` (ellipse paper, eqs. 8 to 12): constant velocity, constant angular velocity, constant radii.
ObjectState predict(const ObjectState& x, double dt_s);

/// F of that step; it depends on the time alone.
Matrix8d process_jacobian(double dt_s);

/// Covariance that the process noise adds in `dt_s`. Integrated over continuous time, so that one long step and many
/// short ones give the same.
Matrix8d process_covariance(double dt_s, const ProcessNoise& noise);

/// h(x): the ellipse in the level frame (ellipse paper, eqs. 13 to 15).
Ellipse measure(const ObjectState& x, const Pose2& T_world_level);

/// z (-) h, with psi wrapped to [-pi, pi].
Vector5d innovation(const Ellipse& measured_level, const Ellipse& predicted_level);

/// H depends on the robot's heading alone.
Matrix58d measurement_jacobian(const Pose2& T_world_level);
Matrix53d measurement_input_jacobian(const ObjectState& x, const Pose2& T_world_level);

/// g(z): the state of a new element, at rest (ellipse paper, eqs. 16 to 20).
ObjectState map_measurement(const Ellipse& measured_level, const Pose2& T_world_level);

/// G_z, G_u: derivatives of the mapped error state by measurement and robot input.
Eigen::Matrix<double, 8, 5> mapping_jacobian(const Pose2& T_world_level);
Eigen::Matrix<double, 8, 3> mapping_input_jacobian(const Ellipse& measured_level, const Pose2& T_world_level);

/// A measurement of the same curve may be described in four ways: turned by pi (the ellipse paper's ambiguity) and by
/// +-pi/2 with its radii swapped. Each with its covariance.
struct Measurement {
  Ellipse ellipse_level;
  Matrix5d covariance = Matrix5d::Zero();
};
std::array<Measurement, 4> equivalent_measurements(const Measurement& measurement);

/// An innovation with its covariance.
struct Match {
  Measurement measurement;
  Vector5d nu = Vector5d::Zero();
  Matrix5d S = Matrix5d::Identity();
  double mahalanobis2 = 0.0;
  double log_det_S = 0.0;
};

/// Compare an element with a measurement in the description of it that is nearest to the element (circle paper,
/// eqs. 24 to 26; ellipse paper, Sect. V-C). `robot_covariance` is of (t_x, t_y, yaw).
Match match(const ObjectState& x, const Matrix8d& P, const Pose2& T_world_level, const Measurement& measurement,
            const Eigen::Matrix3d& robot_covariance);

/// Correct state and covariance (circle paper, eqs. 27 to 30, in Joseph's form, which keeps P symmetric positive
/// definite).
void update(ObjectState& x, Matrix8d& P, const Pose2& T_world_level, const Match& match,
            const Eigen::Matrix3d& robot_covariance);

/// The same element described with rx >= ry.
void make_canonical(ObjectState& x, Matrix8d& P);

}  // namespace situation_awareness

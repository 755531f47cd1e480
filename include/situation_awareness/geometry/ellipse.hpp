// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <array>
#include <optional>
#include <vector>

#include <Eigen/Core>

#include "situation_awareness/geometry/angles.hpp"
#include "situation_awareness/geometry/pose2.hpp"

namespace situation_awareness {

using Matrix5d = Eigen::Matrix<double, 5, 5>;
using Vector5d = Eigen::Matrix<double, 5, 1>;

/// Ellipse in the plane of some frame b (ellipse paper, Sect. III-B): centre, orientation of its own x axis in b, and
/// semi-axes along its own x and y axes. Four parameter sets describe the same curve; `canonical` picks one.
struct Ellipse {
  Eigen::Vector2d center_m = Eigen::Vector2d::Zero();
  double psi_rad = 0.0;
  double rx_m = 0.0;
  double ry_m = 0.0;
};

/// The same curve with rx >= ry and psi in [-pi/2, pi/2].
Ellipse canonical(const Ellipse& ellipse);

/// The ellipse `ellipse_b` of frame b seen in frame a.
Ellipse operator*(const Pose2& T_a_b, const Ellipse& ellipse_b);

/// Shape matrix C (2x2, m^2): the curve is (x - t)^T C^-1 (x - t) = 1, and sqrt(n^T C n) is its half width along a unit
/// vector n.
Eigen::Matrix2d shape_matrix(const Ellipse& ellipse);

/// Half width of the ellipse along a unit vector; along any other, times its length.
double half_width_m(const Ellipse& ellipse, const Eigen::Vector2d& direction);

/// The four ends of the principal axes, counter-clockwise from +x (ellipse paper, Fig. 4).
std::array<Eigen::Vector2d, 4> characteristic_points(const Ellipse& ellipse);

/// Points on the curve, counter-clockwise from +x, at equal steps of the parameter angle.
std::vector<Eigen::Vector2d> points_on(const Ellipse& ellipse, int count);

/// Mean distance of the four characteristic points (ellipse paper, eq. 1), pairing them in order.
double characteristic_distance(const Ellipse& a, const Ellipse& b);

/// The same, over the pairing that a rotation of either ellipse by pi leaves unchanged: the smaller of the two.
double symmetric_characteristic_distance(const Ellipse& a, const Ellipse& b);

/// The ellipse (t_x, t_y, m, p, q) with m = (rx + ry) / 2 and (p, q) = (rx - ry) / 2 (cos 2 psi, sin 2 psi): smooth
/// everywhere, at circles and at psi = +-pi/2 too.
Vector5d smooth_parameters(const Ellipse& ellipse);
Ellipse ellipse_from_smooth_parameters(const Vector5d& parameters);

/// Derivatives of psi, and of (rx, ry), by (m, p, q). That of psi grows without bound towards a circle.
Eigen::RowVector3d psi_jacobian(const Ellipse& ellipse);
Eigen::Matrix<double, 2, 3> radii_jacobian(const Ellipse& ellipse);

/// Variance of an unknown axis: uniform over half a turn.
constexpr double kUniformAxisVariance = kPi * kPi / 12.0;  // rad^2

/// Distance from `origin` along the unit vector `direction` to the first crossing of the curve in front of the origin,
/// or nothing if the ray misses. From inside, the crossing is where the ray leaves.
std::optional<double> intersect_ray(const Ellipse& ellipse, const Eigen::Vector2d& origin,
                                    const Eigen::Vector2d& direction);

/// Distance of a point from the curve, negative inside; to 1e-6 of the longer semi-axis.
double offset_m(const Ellipse& ellipse, const Eigen::Vector2d& point);

/// True if `point` lies inside or on the curve.
bool contains(const Ellipse& ellipse, const Eigen::Vector2d& point);

}  // namespace situation_awareness

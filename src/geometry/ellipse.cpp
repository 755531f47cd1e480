// SPDX-License-Identifier: BSD-3-Clause
#include "situation_awareness/geometry/ellipse.hpp"

#include <algorithm>
#include <cmath>
#include <utility>

#include "situation_awareness/geometry/angles.hpp"

namespace situation_awareness {

Ellipse canonical(const Ellipse& ellipse) {
  Ellipse result = ellipse;
  if (result.rx_m < result.ry_m) {
    std::swap(result.rx_m, result.ry_m);
    result.psi_rad += kPi / 2.0;
  }
  result.psi_rad = wrap_to_half_pi(result.psi_rad);
  return result;
}

Ellipse operator*(const Pose2& T_a_b, const Ellipse& ellipse_b) {
  return {T_a_b * ellipse_b.center_m, T_a_b.yaw_rad + ellipse_b.psi_rad, ellipse_b.rx_m, ellipse_b.ry_m};
}

Eigen::Matrix2d shape_matrix(const Ellipse& ellipse) {
  const Eigen::Matrix2d R = Eigen::Rotation2Dd(ellipse.psi_rad).toRotationMatrix();
  const Eigen::Vector2d squared_radii(ellipse.rx_m * ellipse.rx_m, ellipse.ry_m * ellipse.ry_m);
  return R * squared_radii.asDiagonal() * R.transpose();
}

double half_width_m(const Ellipse& ellipse, const Eigen::Vector2d& direction) {
  return std::sqrt(direction.dot(shape_matrix(ellipse) * direction));
}

std::array<Eigen::Vector2d, 4> characteristic_points(const Ellipse& ellipse) {
  const Eigen::Vector2d x_axis(std::cos(ellipse.psi_rad), std::sin(ellipse.psi_rad));
  const Eigen::Vector2d y_axis(-x_axis.y(), x_axis.x());
  return {ellipse.center_m + ellipse.rx_m * x_axis, ellipse.center_m + ellipse.ry_m * y_axis,
          ellipse.center_m - ellipse.rx_m * x_axis, ellipse.center_m - ellipse.ry_m * y_axis};
}

std::vector<Eigen::Vector2d> points_on(const Ellipse& ellipse, int count) {
  const Pose2 T_frame_ellipse{ellipse.center_m, ellipse.psi_rad};
  std::vector<Eigen::Vector2d> points;
  points.reserve(static_cast<std::size_t>(count));
  for (int i = 0; i < count; ++i) {
    const double angle_rad = 2.0 * kPi * i / count;
    points.push_back(T_frame_ellipse *
                     Eigen::Vector2d(ellipse.rx_m * std::cos(angle_rad), ellipse.ry_m * std::sin(angle_rad)));
  }
  return points;
}

double characteristic_distance(const Ellipse& a, const Ellipse& b) {
  const auto points_a = characteristic_points(a);
  const auto points_b = characteristic_points(b);
  double sum = 0.0;
  for (std::size_t i = 0; i < points_a.size(); ++i) sum += (points_a[i] - points_b[i]).norm();
  return sum / 4.0;
}

double symmetric_characteristic_distance(const Ellipse& a, const Ellipse& b) {
  Ellipse b_turned = b;
  b_turned.psi_rad += kPi;
  return std::min(characteristic_distance(a, b), characteristic_distance(a, b_turned));
}

Vector5d smooth_parameters(const Ellipse& ellipse) {
  const double half_difference = 0.5 * (ellipse.rx_m - ellipse.ry_m);
  Vector5d x;
  x << ellipse.center_m, 0.5 * (ellipse.rx_m + ellipse.ry_m), half_difference * std::cos(2.0 * ellipse.psi_rad),
      half_difference * std::sin(2.0 * ellipse.psi_rad);
  return x;
}

Ellipse ellipse_from_smooth_parameters(const Vector5d& parameters) {
  const double half_difference = parameters.tail<2>().norm();
  return {parameters.head<2>(), 0.5 * std::atan2(parameters(4), parameters(3)), parameters(2) + half_difference,
          parameters(2) - half_difference};
}

Eigen::RowVector3d psi_jacobian(const Ellipse& ellipse) {
  const double difference = std::max(ellipse.rx_m - ellipse.ry_m, 1e-6);
  return {0.0, -std::sin(2.0 * ellipse.psi_rad) / difference, std::cos(2.0 * ellipse.psi_rad) / difference};
}

Eigen::Matrix<double, 2, 3> radii_jacobian(const Ellipse& ellipse) {
  const double c = std::cos(2.0 * ellipse.psi_rad);
  const double s = std::sin(2.0 * ellipse.psi_rad);
  Eigen::Matrix<double, 2, 3> J;
  J << 1.0, c, s, 1.0, -c, -s;
  return J;
}

std::optional<double> intersect_ray(const Ellipse& ellipse, const Eigen::Vector2d& origin,
                                    const Eigen::Vector2d& direction) {
  // In the ellipse's own frame, scaled by its radii, the curve is the unit circle: |o + s d|^2 = 1.
  const Eigen::Matrix2d R_ellipse = Eigen::Rotation2Dd(-ellipse.psi_rad).toRotationMatrix();
  const Eigen::Vector2d inverse_radii(1.0 / ellipse.rx_m, 1.0 / ellipse.ry_m);
  const Eigen::Vector2d o = inverse_radii.cwiseProduct(R_ellipse * (origin - ellipse.center_m));
  const Eigen::Vector2d d = inverse_radii.cwiseProduct(R_ellipse * direction);
  const double a = d.squaredNorm();
  const double half_b = o.dot(d);
  const double c = o.squaredNorm() - 1.0;
  const double discriminant = half_b * half_b - a * c;
  if (discriminant < 0.0) return std::nullopt;
  const double root = std::sqrt(discriminant);
  const double near = (-half_b - root) / a;
  if (near >= 0.0) return near;
  const double far = (-half_b + root) / a;
  if (far >= 0.0) return far;
  return std::nullopt;
}

double offset_m(const Ellipse& ellipse, const Eigen::Vector2d& point) {
  // In the first quadrant of the ellipse's own frame, towards the nearest point (a t.x, b t.y) with |t| = 1: near any
  // of its points the curve is a circle about the centre of curvature there, on which the nearest point is known.
  const double a = ellipse.rx_m;
  const double b = ellipse.ry_m;
  const Eigen::Vector2d p = (Eigen::Rotation2Dd(-ellipse.psi_rad) * (point - ellipse.center_m)).cwiseAbs();
  Eigen::Vector2d t = Eigen::Vector2d::Constant(std::sqrt(0.5));
  for (int i = 0; i < 8; ++i) {
    const Eigen::Vector2d center((a * a - b * b) * t.x() * t.x() * t.x() / a,
                                 (b * b - a * a) * t.y() * t.y() * t.y() / b);
    const double radius_m = (Eigen::Vector2d(a * t.x(), b * t.y()) - center).norm();
    const double distance_m = (p - center).norm();
    if (!(distance_m > 0.0)) break;  // all points of the circle are equally near
    const Eigen::Vector2d nearest_m = center + radius_m / distance_m * (p - center);
    const Eigen::Vector2d next =
        Eigen::Vector2d(nearest_m.x() / a, nearest_m.y() / b).cwiseMax(0.0).cwiseMin(1.0).normalized();
    if (next == t) break;  // and so would be all that follow
    t = next;
  }
  const double distance_m = (p - Eigen::Vector2d(a * t.x(), b * t.y())).norm();
  return contains(ellipse, point) ? -distance_m : distance_m;
}

bool contains(const Ellipse& ellipse, const Eigen::Vector2d& point) {
  const Eigen::Vector2d p = Eigen::Rotation2Dd(-ellipse.psi_rad) * (point - ellipse.center_m);
  return Eigen::Vector2d(p.x() / ellipse.rx_m, p.y() / ellipse.ry_m).squaredNorm() <= 1.0;
}

}  // namespace situation_awareness

// SPDX-License-Identifier: BSD-3-Clause
#include "situation_awareness/map/polygons/movers.hpp"

#include <algorithm>
#include <cmath>
#include <limits>

namespace situation_awareness {
namespace {

/// A vector by its parts along an axis and to the left of it.
Eigen::Vector2d in_axes(const Eigen::Vector2d& along, const Eigen::Vector2d& d) {
  return {along.dot(d), along.x() * d.y() - along.y() * d.x()};
}

}  // namespace

MoverOutline::MoverOutline(const Ellipse& world, double margin_m)
    : center_world_m_(world.center_m),
      along_world_(std::cos(world.psi_rad), std::sin(world.psi_rad)),
      half_m_(world.rx_m, world.ry_m),
      is_box_(false),
      margin_m_(margin_m),
      reach_m_(half_m_.maxCoeff() + margin_m) {}

MoverOutline::MoverOutline(const Box& world, double margin_m)
    : center_world_m_(world.center_m),
      along_world_(std::cos(world.psi_rad), std::sin(world.psi_rad)),
      half_m_(world.half_length_m, world.half_width_m),
      is_box_(true),
      margin_m_(margin_m),
      reach_m_(half_m_.norm() + margin_m) {}

bool MoverOutline::covers(const Eigen::Vector2d& p_world_m) const {
  const Eigen::Vector2d d_m = p_world_m - center_world_m_;
  const double distance2_m2 = d_m.squaredNorm();
  if (distance2_m2 > reach_m_ * reach_m_) return false;
  const Eigen::Vector2d own_m = in_axes(along_world_, d_m);
  if (is_box_) return (own_m.cwiseAbs() - half_m_).cwiseMax(0.0).squaredNorm() <= margin_m_ * margin_m_;
  // Along the way from the centre the outline is at 1 / scale.
  const double scale = own_m.cwiseQuotient(half_m_).norm();
  return scale <= 1.0 || std::sqrt(distance2_m2) * (1.0 - 1.0 / scale) <= margin_m_;
}

std::optional<MoverOutline::Crossing> MoverOutline::crossing(const Eigen::Vector2d& origin_world_m,
                                                             const Eigen::Vector2d& direction_world) const {
  const Eigen::Vector2d from_m = in_axes(along_world_, origin_world_m - center_world_m_);
  const Eigen::Vector2d u = in_axes(along_world_, direction_world);
  Crossing result;
  if (is_box_) {  // inside both strips between opposite sides
    result = {-std::numeric_limits<double>::infinity(), std::numeric_limits<double>::infinity()};
    for (int axis = 0; axis < 2; ++axis) {
      if (u(axis) == 0.0) {
        if (std::abs(from_m(axis)) > half_m_(axis)) return std::nullopt;
        continue;
      }
      const double to_middle_m = -from_m(axis) / u(axis), half_m = std::abs(half_m_(axis) / u(axis));
      result.entry_m = std::max(result.entry_m, to_middle_m - half_m);
      result.exit_m = std::min(result.exit_m, to_middle_m + half_m);
    }
  } else {  // |f + t v| = 1 in units of the semi-axes
    const Eigen::Vector2d f = from_m.cwiseQuotient(half_m_), v = u.cwiseQuotient(half_m_);
    const double b = f.dot(v), a = v.squaredNorm(), discriminant = b * b - a * (f.squaredNorm() - 1.0);
    if (discriminant < 0.0) return std::nullopt;
    const double root = std::sqrt(discriminant);
    result = {(-b - root) / a, (-b + root) / a};
  }
  if (!(result.entry_m < result.exit_m) || result.entry_m < 0.0) return std::nullopt;
  return result;
}

}  // namespace situation_awareness

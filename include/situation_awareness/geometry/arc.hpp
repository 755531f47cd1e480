// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cmath>

#include <Eigen/Core>

#include "situation_awareness/geometry/angles.hpp"
#include "situation_awareness/geometry/pose2.hpp"

namespace situation_awareness {

/// An arc of a circle with a direction, in any frame. The sign of the sweep is that of the turn, also of a sweep of
/// zero: 0.0 turns left, -0.0 right.
struct Arc {
  Eigen::Vector2d center_m = Eigen::Vector2d::Zero();
  double radius_m = 1.0;   ///< > 0
  double from_rad = 0.0;   ///< polar angle of the begin, at the centre
  double sweep_rad = 0.0;  ///< from there on, counter-clockwise positive
};

inline double length_m(const Arc& arc) { return arc.radius_m * std::abs(arc.sweep_rad); }

/// Point and heading `way_m` after the begin, also before it and beyond the end.
inline Pose2 pose_at(const Arc& arc, double way_m) {
  const double sign = std::copysign(1.0, arc.sweep_rad);
  const double polar_rad = arc.from_rad + sign * way_m / arc.radius_m;
  return {arc.center_m + arc.radius_m * Eigen::Vector2d(std::cos(polar_rad), std::sin(polar_rad)),
          polar_rad + sign * 0.5 * kPi};
}

/// Bulge of an arc, tan(sweep / 4), as in DXF: the height of the arc over half its chord, counter-clockwise positive.
/// The sweep is in (-2 pi, 2 pi).
inline double bulge(const Arc& arc) { return std::tan(0.25 * arc.sweep_rad); }

/// The arc between two points, which differ, with a bulge, which is not zero.
inline Arc arc_with_bulge(const Eigen::Vector2d& from_m, const Eigen::Vector2d& to_m, double bulge) {
  const Eigen::Vector2d chord = to_m - from_m;
  const Eigen::Vector2d normal(-chord.y(), chord.x());
  // Of a half chord 1 the circle has the radius (1 + b^2) / (2 |b|), and its centre (1 - b^2) / (2 b) left of the
  // chord.
  const Eigen::Vector2d to_center = 0.5 * chord + 0.25 * (1.0 / bulge - bulge) * normal;
  return {from_m + to_center, 0.25 * chord.norm() * (1.0 / std::abs(bulge) + std::abs(bulge)),
          std::atan2(-to_center.y(), -to_center.x()), 4.0 * std::atan(bulge)};
}

}  // namespace situation_awareness

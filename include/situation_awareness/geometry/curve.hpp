// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <optional>

#include <Eigen/Core>

#include "situation_awareness/geometry/arc.hpp"

namespace situation_awareness {

/// An arc of a circle or a straight line, by its begin, with a direction; in any frame. One turn at most.
struct Curve {
  Eigen::Vector2d from_m = Eigen::Vector2d::Zero();
  Eigen::Vector2d along = Eigen::Vector2d::UnitX();  ///< unit, the direction at the begin
  double curvature_1_m = 0.0;                        ///< left positive; 0: straight
  double length_m = 0.0;
};

Curve straight_curve(const Eigen::Vector2d& from_m, const Eigen::Vector2d& to_m);

/// A sweep of more than one turn is taken for one.
Curve curve_of(const Arc& arc);

/// The arc between two points, which differ, with the bulge of geometry/arc.hpp, which may be zero.
Curve curve_with_bulge(const Eigen::Vector2d& from_m, const Eigen::Vector2d& to_m, double bulge);

/// The point `way_m` after the begin, also before it and beyond the end, and the direction there.
Eigen::Vector2d point_at(const Curve& curve, double way_m);
Eigen::Vector2d along_at(const Curve& curve, double way_m);

/// The part of a curve between two ways, 0 <= from_m <= to_m <= length.
Curve part_of(const Curve& curve, double from_m, double to_m);

/// The way, in [0, length], of the curve's nearest point.
double nearest_m(const Curve& curve, const Eigen::Vector2d& p_m);

double distance_m(const Curve& curve, const Eigen::Vector2d& p_m);

/// The least distance of two curves, 0 where they meet. It is between an end and the other curve, or where both have a
/// common normal: through the centres of arcs, across lines.
double distance_m(const Curve& a, const Curve& b);

/// The least way along `a` at which it enters what is nearer to `b` than `margin_m` > 0: 0 if it begins there, none if
/// it nowhere does, or touches it only. That region's edge consists of the two curves beside `b` and of circles about
/// its ends; each way at which `a` meets one of them is computed.
std::optional<double> first_nearer_m(const Curve& a, const Curve& b, double margin_m);

}  // namespace situation_awareness

// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cmath>

#include "situation_awareness/points/points.hpp"
#include "situation_awareness/segments/segments.hpp"

namespace situation_awareness {

// How real outlines differ from boxes and ellipses; for the fit of boxes, and for the comparison of both shapes.

/// Standard deviation of the distance of hits from the outline, in m: rounded corners, handles, wheels.
constexpr double kRoughness_m = 0.015;
/// That of the silhouette, in m: what sticks out at another height, or is rounded.
constexpr double kSilhouetteRoughness_m = 0.03;
/// Standard deviation of the silhouette at an end, in m, where the object extends beyond its last hit (`beyond`) or
/// not. `hidden_rad`: at an end of kind kNoReturn, the azimuth in which it may lie.
inline double end_sigma_m(const Point& end, SegmentEnd kind, double hidden_rad, bool beyond, double resolution_rad) {
  const double sigma_m = std::hypot(end.range_m * resolution_rad / std::sqrt(12.0), kSilhouetteRoughness_m);
  const bool weak = beyond && kind == SegmentEnd::kNoReturn;
  return weak ? std::hypot(sigma_m, end.range_m * hidden_rad / std::sqrt(3.0)) : sigma_m;
}

/// Standard deviations beyond which a residual is an outlier.
constexpr double kOutlier = 2.5;

/// Square of a residual in standard deviations, growing linearly beyond kOutlier (Huber, 1964).
inline double huber(double residual) {
  const double size = std::abs(residual);
  return size <= kOutlier ? size * size : kOutlier * (2.0 * size - kOutlier);
}

/// Weight of the residual in the normal equations.
inline double huber_weight(double residual) {
  const double size = std::abs(residual);
  return size <= kOutlier ? 1.0 : kOutlier / size;
}

}  // namespace situation_awareness

// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstdint>

#include <Eigen/Core>

#include "situation_awareness/map/objects/people.hpp"
#include "situation_awareness/map/objects/shape_belief.hpp"

// Common to the sources of People. Each constant has its unit and its source (docs/math/people.md, "Constants").
namespace situation_awareness {

/// m. Radius of the circle that stands for a person: half the width of the shoulders or the pelvis.
constexpr double kPersonRadius_m = 0.2;
/// m. Standard deviation of that.
constexpr double kPersonRadiusSigma_m = 0.03;
/// m. Standard deviation of the mean radius of a leg, and of its (p, q).
constexpr double kLegRadiusSigma_m = 0.03;
/// m. Two legs side by side have no larger semi-axis.
constexpr double kMaxBothLegs_m = 0.35;
/// m. A leg has no larger semi-axis.
constexpr double kMaxLeg_m = 0.14;
/// m. Standard deviation of a leg's way from the middle, per axis, when it walks, and of what has not been seen.
constexpr double kStride_m = 0.18;
/// m. Standard deviation of the hips about the middle of both legs.
constexpr double kHips_m = 0.07;
/// m. Legs are at most this far apart.
constexpr double kMaxApart_m = 0.9;
/// s. Both legs appeared within this time, or have stood for as long.
constexpr double kSamePast_s = 1.0;
/// m. Where a leg may be, from the middle.
constexpr double kReach_m = 0.55;

/// The measurement of the middle.
inline Measurement middle_at(const Eigen::Vector2d& center_level_m, const Eigen::Matrix2d& R, double time_offset_s) {
  Measurement middle;
  middle.z << center_level_m, kPersonRadius_m, 0.0, 0.0;
  middle.R.setZero();
  middle.R.topLeftCorner<2, 2>() = R;
  middle.R.diagonal().tail<3>().array() = kPersonRadiusSigma_m * kPersonRadiusSigma_m;
  middle.time_offset_s = time_offset_s;
  return middle;
}

/// m. Larger semi-axis.
inline double larger_radius_m(const Vector8d& x) {
  return x(object_state::kShape) + x.segment<2>(object_state::kShape + 1).norm();
}

/// True for an element that may be one leg.
inline bool is_foot(const MapElement& element, std::int64_t stamp_ns) {
  if (element.state == TrackState::kDeleted || is_person(element) || element.last_seen_ns != stamp_ns) return false;
  if (is_box(element)) return false;
  if (element.state == TrackState::kTentative && element.observations < 2) return false;
  return larger_radius_m(likelier(element.estimate).x) <= kMaxLeg_m;
}

}  // namespace situation_awareness

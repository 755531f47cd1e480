// SPDX-License-Identifier: BSD-3-Clause
#include "situation_awareness/path/dubins_following.hpp"

#include <algorithm>
#include <cmath>
#include <limits>
#include <variant>

#include "situation_awareness/geometry/angles.hpp"
#include "situation_awareness/path/segment_path.hpp"

namespace situation_awareness {
namespace {

// Where no source is named, none is recorded; the sensitivity of these was not measured.

/// So many of the vehicle's radii beside the path it heads for the path at 45 degrees.
constexpr double kApproachRadii = 2.5;
/// Curvature, in units of the greatest one, for each rad of error of heading.
constexpr double kGainHeadingRadii = 2.0;

/// Errors of rounding in sums of lengths.
constexpr double kAtEnd_m = 1e-6;

/// The way along an arc, in [low_m, high_m], that is nearest to a point: that of its direction from the centre, or the
/// end that is nearer in angle.
double nearest_on(const Arc& arc, const Eigen::Vector2d& p_m, double low_m, double high_m) {
  const Eigen::Vector2d out = p_m - arc.center_m;
  const double middle_m = 0.5 * (low_m + high_m);
  const double sign = std::copysign(1.0, arc.sweep_rad);
  const double polar_rad = arc.from_rad + sign * middle_m / arc.radius_m;
  const double from_middle_rad = sign * wrap_to_pi(std::atan2(out.y(), out.x()) - polar_rad);
  return std::clamp(middle_m + arc.radius_m * from_middle_rad, low_m, high_m);
}

double nearest_on(const Straight& straight, const Eigen::Vector2d& p_m, double low_m, double high_m) {
  const Eigen::Vector2d ahead(std::cos(straight.heading_rad), std::sin(straight.heading_rad));
  return std::clamp(ahead.dot(p_m - straight.from_m), low_m, high_m);
}

template <class AnyPath>
double nearest_on_path(const AnyPath& path, const Eigen::Vector2d& p_m, double from_m, double to_m) {
  double best_m = std::clamp(from_m, 0.0, path.length_m);
  double least_m = (place_at(path, best_m).pose.translation_m - p_m).norm();
  double begin_m = 0.0;
  for (const DubinsSegment& segment : path.segments) {
    const double segment_m = length_m(segment);
    const double low_m = std::max(0.0, from_m - begin_m), high_m = std::min(segment_m, to_m - begin_m);
    if (low_m <= high_m) {
      const double in_segment_m =
          std::visit([&](const auto& one) { return nearest_on(one, p_m, low_m, high_m); }, segment);
      const double distance_m = (place_at(&segment, &segment + 1, in_segment_m).pose.translation_m - p_m).norm();
      if (distance_m < least_m) {
        least_m = distance_m;
        best_m = begin_m + in_segment_m;
      }
    }
    begin_m += segment_m;
  }
  return best_m;
}

template <class AnyPath>
DubinsFollowingResult follow_path(const AnyPath& path, const DubinsFollowingParams& params, const Pose2& T_world_base,
                                  double speed_m_s, double way_m) {
  const double K = params.max_curvature_1_m;
  DubinsFollowingResult result;
  result.way_m = nearest_on_path(path, T_world_base.translation_m, way_m, way_m + 0.5 / K);
  const DubinsPlace reference = place_at(path, result.way_m);
  result.error = following_error(reference.pose, T_world_base);
  result.arrived = result.way_m >= path.length_m - kAtEnd_m && result.error.along_m >= -kAtEnd_m;

  const double ahead_m = result.way_m + speed_m_s * params.reaction_s;
  const double kappa_r = ahead_m < path.length_m - kAtEnd_m ? place_at(path, ahead_m).curvature_1_m : 0.0;
  // The reference moves with cos theta_e / (1 - kappa y_e) of the vehicle's speed.
  const double reference_1_m = kappa_r * std::cos(result.error.heading_rad) /
                               std::max(1.0 - reference.curvature_1_m * result.error.across_m, 0.2);
  const double heading_rad = -std::atan(result.error.across_m * K / kApproachRadii);
  const double turn_rad = wrap_to_pi(result.error.heading_rad - heading_rad);
  // Of the heading, to turn the course by one rad; and so much less a vehicle can turn at its least radius.
  const double turns = params.airspeed_m_s > 0.0 && speed_m_s > 0.0 ? speed_m_s / params.airspeed_m_s : 1.0;
  const double curvature_1_m = turns * (reference_1_m - kGainHeadingRadii * K * turn_rad);
  result.curvature_1_m = std::clamp(curvature_1_m, -K / turns, K / turns);
  return result;
}

}  // namespace

void DubinsFollowingParams::validate() const { check_bounds(*this, "dubins_following"); }

bool may_follow(const DubinsPath& path, double max_curvature_1_m) {
  return std::all_of(path.segments.begin(), path.segments.end(), [max_curvature_1_m](const DubinsSegment& segment) {
    const Arc* arc = std::get_if<Arc>(&segment);
    return arc == nullptr || arc->sweep_rad == 0.0 || may_turn(arc->radius_m, max_curvature_1_m);
  });
}

double nearest_m(const DubinsPath& path, const Eigen::Vector2d& p_m, double from_m, double to_m) {
  return nearest_on_path(path, p_m, from_m, to_m);
}

double nearest_m(const SegmentPath& path, const Eigen::Vector2d& p_m, double from_m, double to_m) {
  return nearest_on_path(path, p_m, from_m, to_m);
}

DubinsFollowingResult follow(const DubinsPath& path, const DubinsFollowingParams& params, const Pose2& T_world_base,
                             double speed_m_s, double way_m) {
  return follow_path(path, params, T_world_base, speed_m_s, way_m);
}

DubinsFollowingResult follow(const SegmentPath& path, const DubinsFollowingParams& params, const Pose2& T_world_base,
                             double speed_m_s, double way_m) {
  return follow_path(path, params, T_world_base, speed_m_s, way_m);
}

}  // namespace situation_awareness

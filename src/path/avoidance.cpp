// SPDX-License-Identifier: BSD-3-Clause
#include "situation_awareness/path/avoidance.hpp"

#include <algorithm>
#include <cmath>
#include <variant>

#include "situation_awareness/geometry/angles.hpp"
#include "situation_awareness/geometry/vectors.hpp"

namespace situation_awareness {
namespace {

/// m. Where a vehicle is nearer than the margin, so much nearer it may come, for errors of its place.
constexpr double kNoNearer_m = 0.02;
/// m. An obstacle that the vehicle seems to touch still has this margin.
constexpr double kLeastMargin_m = 0.05;

Curve curve_of_segment(const DubinsSegment& segment) {
  if (const Arc* arc = std::get_if<Arc>(&segment)) return curve_of(*arc);
  const Straight& straight = *std::get_if<Straight>(&segment);
  return {straight.from_m,
          {std::cos(straight.heading_rad), std::sin(straight.heading_rad)},
          0.0,
          (straight.to_m - straight.from_m).norm()};
}

double margin_of(double sigma_m, double pose_sigma_m, const AvoidanceParams& params) {
  return std::max(params.clearance_m + params.sigmas * std::hypot(sigma_m, pose_sigma_m), kLeastMargin_m);
}

}  // namespace

void AvoidanceParams::validate() const { check_bounds(*this, "avoidance"); }

double stopping_way_m(double speed_m_s, const AvoidanceParams& params) {
  const double stop_m =
      params.braking_m_s2 > 0.0 ? 0.5 * speed_m_s * speed_m_s / params.braking_m_s2 : 0.5 * kPi * params.turn_radius_m;
  return speed_m_s * params.reaction_s + stop_m;
}

double margin_m(const ObstaclePiece& piece, double pose_sigma_m, const AvoidanceParams& params) {
  return margin_of(piece.sigma_m, pose_sigma_m, params);
}

PathCheck check(const SegmentPath& path, double from_m, double to_m, const Obstacles& obstacles, double pose_sigma_m,
                const AvoidanceParams& params) {
  PathCheck result;
  result.free_m = to_m = std::min(to_m, path.length_m);
  if (path.segments.empty()) return result;
  const Eigen::Vector2d begin_m = place_at(path, from_m).pose.translation_m;
  double segment_begin_m = 0.0;
  for (const DubinsSegment& segment : path.segments) {
    const double low_m = std::max(from_m - segment_begin_m, 0.0);
    const double high_m = std::min(to_m - segment_begin_m, length_m(segment));
    if (low_m < high_m) {
      const Curve whole = curve_of_segment(segment);
      const Curve curve = part_of(whole, low_m, std::min(high_m, std::max(whole.length_m, low_m)));
      const double half_m = 0.5 * curve.length_m;
      const Eigen::Vector2d middle_m = point_at(curve, half_m);
      for (const PieceRun& run : obstacles.runs()) {
        const double run_m = half_m + run.radius_m + margin_of(run.sigma_m, pose_sigma_m, params);
        if ((middle_m - run.middle_m).squaredNorm() > run_m * run_m) continue;
        for (std::size_t i = run.first; i < run.end; ++i) {
          const ObstaclePiece& piece = obstacles.pieces()[i];
          double margin = margin_m(piece, pose_sigma_m, params);
          const double reach_m = half_m + piece.half_m + margin;
          if ((middle_m - piece.middle_m).squaredNorm() > reach_m * reach_m) continue;
          const double own_reach_m = piece.half_m + margin;
          if ((begin_m - piece.middle_m).squaredNorm() < own_reach_m * own_reach_m) {
            margin = std::max(std::min(margin, distance_m(piece.curve, begin_m) - kNoNearer_m), kLeastMargin_m);
          }
          const std::optional<double> nearer_m = first_nearer_m(curve, piece.curve, margin);
          if (!nearer_m) continue;
          const double way_m = segment_begin_m + low_m + *nearer_m;
          if (way_m >= result.free_m && !result.free) continue;
          result = {false, way_m, i};
        }
      }
      if (!result.free) return result;
    }
    segment_begin_m += length_m(segment);
  }
  return result;
}

double clearance_m(const SegmentPath& path, const Obstacles& obstacles) {
  double least_m = std::numeric_limits<double>::infinity();
  for (const DubinsSegment& segment : path.segments) {
    const Curve curve = curve_of_segment(segment);
    const Eigen::Vector2d middle_m = point_at(curve, 0.5 * curve.length_m);
    for (const PieceRun& run : obstacles.runs()) {
      if ((middle_m - run.middle_m).norm() - 0.5 * curve.length_m - run.radius_m >= least_m) continue;
      for (std::size_t i = run.first; i < run.end; ++i) {
        const ObstaclePiece& piece = obstacles.pieces()[i];
        if ((middle_m - piece.middle_m).norm() - 0.5 * curve.length_m - piece.half_m >= least_m) continue;
        least_m = std::min(least_m, distance_m(curve, piece.curve));
      }
    }
  }
  return least_m;
}

Arc holding_circle(const Pose2& from, double side, const AvoidanceParams& params) {
  const Eigen::Vector2d ahead(std::cos(from.yaw_rad), std::sin(from.yaw_rad));
  return {from.translation_m + side * params.turn_radius_m * left_of(ahead), params.turn_radius_m,
          from.yaw_rad - side * 0.5 * kPi, side * 2.0 * kPi};
}

bool plan_around(const Pose2& from, const DubinsEnd& to, const Obstacles& obstacles, double pose_sigma_m,
                 const AvoidanceParams& params, SegmentPath& path) {
  const double radius_m = params.turn_radius_m;
  const DubinsEnd begin{from.translation_m, from.yaw_rad, radius_m};
  clear(path);
  append(path, shortest_dubins_path(begin, to));
  const PathCheck direct = check(path, 0.0, path.length_m, obstacles, pose_sigma_m, params);
  if (direct.free) return true;

  // Beside the place: across the way to the end, at the clearance and further off; heading there, or a bit aside.
  const ObstaclePiece& piece = obstacles.pieces()[direct.piece];
  const Eigen::Vector2d place_m =
      point_at(piece.curve, nearest_m(piece.curve, place_at(path, direct.free_m).pose.translation_m));
  const double keep_m = margin_m(piece, pose_sigma_m, params) + 0.1 * radius_m;
  const Eigen::Vector2d way_m = to.p_m - from.translation_m;
  const double yaw_rad = way_m.norm() > radius_m ? std::atan2(way_m.y(), way_m.x()) : from.yaw_rad;
  const Eigen::Vector2d across = left_of(Eigen::Vector2d(std::cos(yaw_rad), std::sin(yaw_rad)));
  double best_m = std::numeric_limits<double>::infinity();
  DubinsPath best_first, best_second;
  for (const double side : {1.0, -1.0}) {
    for (const double offset_m : {keep_m, keep_m + radius_m, keep_m + 2.0 * radius_m, keep_m + 4.0 * radius_m}) {
      for (const double turn_rad : {0.0, 0.5, -0.5}) {
        const DubinsEnd middle{place_m + side * offset_m * across, yaw_rad + turn_rad, radius_m};
        const DubinsPath first = shortest_dubins_path(begin, middle), second = shortest_dubins_path(middle, to);
        if (first.length_m + second.length_m >= best_m) continue;
        clear(path);
        append(path, first);
        append(path, second);
        if (!check(path, 0.0, path.length_m, obstacles, pose_sigma_m, params).free) continue;
        best_m = path.length_m;
        best_first = first;
        best_second = second;
      }
    }
  }
  clear(path);
  if (std::isinf(best_m)) return false;
  append(path, best_first);
  append(path, best_second);
  return true;
}

}  // namespace situation_awareness

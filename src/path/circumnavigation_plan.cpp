// SPDX-License-Identifier: BSD-3-Clause
// The paths of Circumnavigation: around an obstacle, to a place, and the way out of each.
#include <algorithm>
#include <cmath>
#include <limits>
#include <utility>

#include "situation_awareness/geometry/angles.hpp"
#include "situation_awareness/path/circumnavigation.hpp"

namespace situation_awareness {
namespace {

/// s. Longest time between steps: for so long a decision counts.
constexpr double kStep_s = 0.3;
/// m. Between places of an orbit at which a path may join or leave it.
constexpr double kJoin_m = 3.0;
/// m, rad. A vehicle that is so near to an orbit follows it.
constexpr double kOnOrbit_m = 0.7, kOnOrbit_rad = 0.25;
/// s. Of the patience with a task: what it takes to turn off from a path.
constexpr double kTurnOff_s = 6.0;
/// Of an orbit's length: how far along it a path goes.
constexpr double kOfLap = 0.95;

Pose2 pose_on(const SegmentPath& closed, double way_m) {
  return place_at(closed, std::fmod(way_m, closed.length_m)).pose;
}

DubinsEnd end_of(const Pose2& pose, double radius_m) { return {pose.translation_m, pose.yaw_rad, radius_m}; }

}  // namespace

bool Circumnavigation::is_free(const SegmentPath& path) const {
  return check(path, 0.0, path.length_m, obstacles_, pose_sigma_m_, params_.avoidance).free;
}

bool Circumnavigation::trace(std::size_t obstacle, double side, const Pose2& from, SegmentPath& orbit) {
  const double radius_m = params_.avoidance.turn_radius_m;
  const Eigen::Vector2d hint_m = from * Eigen::Vector2d(0.0, -side * radius_m);
  return orbits_.trace(obstacles_, obstacle, side, params_.standoff_m, radius_m, hint_m, orbit);
}

/// The shortest free way to an orbit, as `path`; the length, infinite if there is none. `way_m`: where it joins.
double Circumnavigation::join(const Pose2& from, const SegmentPath& orbit, SegmentPath& path, double& way_m) const {
  const double radius_m = params_.avoidance.turn_radius_m;
  clear(path);
  const double nearest = nearest_m(orbit, from.translation_m, 0.0, orbit.length_m);
  const FollowingError error = following_error(place_at(orbit, nearest).pose, from);
  way_m = nearest;
  if (std::abs(error.across_m) < kOnOrbit_m && std::abs(error.heading_rad) < kOnOrbit_rad) return 0.0;
  double best_m = kInfinite;
  DubinsPath best;
  for (double beyond_m = 0.0; beyond_m < orbit.length_m; beyond_m += kJoin_m) {
    const DubinsPath dubins =
        shortest_dubins_path(end_of(from, radius_m), end_of(pose_on(orbit, nearest + beyond_m), radius_m));
    if (dubins.length_m >= best_m) continue;
    clear(joined_);
    append(joined_, dubins);
    if (!is_free(joined_)) continue;
    best_m = dubins.length_m;
    best = dubins;
    way_m = std::fmod(nearest + beyond_m, orbit.length_m);
  }
  if (best_m < kInfinite) append(path, best);
  return best_m;
}

bool Circumnavigation::plan_along_orbit(const Pose2& from, const DubinsEnd& end, std::size_t obstacle) {
  const double radius_m = params_.avoidance.turn_radius_m;
  double best_m = kInfinite, best_blocked_m = kInfinite;
  SegmentPath& blocked = tried_;
  clear(candidate_);
  clear(blocked);
  for (const double side : {1.0, -1.0}) {
    double way_m = 0.0;
    if (!trace(obstacle, side, from, other_orbit_)) continue;
    const double join_m = join(from, other_orbit_, approach_, way_m);
    if (join_m == kInfinite) continue;
    for (double along_m = 0.0; along_m < kOfLap * other_orbit_.length_m; along_m += kJoin_m) {
      const DubinsPath exit = shortest_dubins_path(end_of(pose_on(other_orbit_, way_m + along_m), radius_m), end);
      const double whole_m = join_m + along_m + exit.length_m;
      if (whole_m >= best_m) continue;
      clear(joined_);
      append(joined_, exit);
      const PathCheck result = check(joined_, 0.0, joined_.length_m, obstacles_, pose_sigma_m_, params_.avoidance);
      if (!result.free) {
        // Else as far as it leads.
        const Eigen::Vector2d rest_m = end.p_m - place_at(joined_, result.free_m).pose.translation_m;
        const double blocked_m = join_m + along_m + result.free_m + 2.0 * rest_m.norm();
        if (best_m < kInfinite || blocked_m >= best_blocked_m || result.free_m < radius_m) continue;
        best_blocked_m = blocked_m;
      } else {
        best_m = whole_m;
      }
      SegmentPath& best = result.free ? candidate_ : blocked;
      clear(best);
      best.segments.insert(best.segments.end(), approach_.segments.begin(), approach_.segments.end());
      best.length_m = approach_.length_m;
      append_part(best, other_orbit_, way_m, way_m + along_m);
      append(best, exit);
    }
  }
  if (best_m == kInfinite) std::swap(candidate_, blocked);
  return !candidate_.segments.empty();
}

bool Circumnavigation::plan_to(const Pose2& from, const DubinsEnd& end) {
  if (plan_around(from, end, obstacles_, pose_sigma_m_, params_.avoidance, candidate_)) return true;
  clear(candidate_);
  append(candidate_, shortest_dubins_path(end_of(from, params_.avoidance.turn_radius_m), end));
  const PathCheck result = check(candidate_, 0.0, candidate_.length_m, obstacles_, pose_sigma_m_, params_.avoidance);
  return result.free || plan_along_orbit(from, end, obstacles_.pieces()[result.piece].obstacle);
}

bool Circumnavigation::plan_to_orbit(const Pose2& from) {
  double way_m = 0.0;
  if (!chose_side_) {
    // The nearer way around.
    double nearest = kInfinite;
    for (const double side : {1.0, -1.0}) {
      if (!trace(target_obstacle_, side, from, other_orbit_)) continue;
      const double each_m = join(from, other_orbit_, tried_, way_m);
      if (each_m >= nearest) continue;
      nearest = each_m;
      side_ = side;
      chose_side_ = true;
    }
  }
  if (!trace(target_obstacle_, side_, from, orbit_)) return false;
  together_.clear();
  for (const Obstacle& obstacle : obstacles_.obstacles()) {
    if (obstacle.kind != ObstacleKind::kObject &&
        turns_around(orbit_, obstacles_.pieces()[obstacle.first].curve.from_m) != 0) {
      together_.push_back(obstacle.id);
    }
  }
  if (join(from, orbit_, candidate_, way_m) < kInfinite) {
    append_part(candidate_, orbit_, way_m, way_m + kOfLap * orbit_.length_m);
    return true;
  }
  // By an intermediate pose, or around what is between.
  const double radius_m = params_.avoidance.turn_radius_m;
  const double nearest = nearest_m(orbit_, from.translation_m, 0.0, orbit_.length_m);
  double best_m = kInfinite;
  clear(tried_);
  for (const double part : {0.0, 0.15, 0.85, 0.3, 0.7, 0.5}) {
    const double at_m = nearest + part * orbit_.length_m;
    if (!plan_around(from, end_of(pose_on(orbit_, at_m), radius_m), obstacles_, pose_sigma_m_, params_.avoidance,
                     joined_) ||
        joined_.length_m >= best_m) {
      continue;
    }
    best_m = joined_.length_m;
    std::swap(tried_, joined_);
    way_m = std::fmod(at_m, orbit_.length_m);
  }
  if (best_m < kInfinite) {
    std::swap(candidate_, tried_);
    append_part(candidate_, orbit_, way_m, way_m + kOfLap * orbit_.length_m);
    return true;
  }
  return plan_to(from, end_of(pose_on(orbit_, nearest), radius_m));
}

bool Circumnavigation::plan(const MissionInput& input) {
  if (has_target_) return plan_to_orbit(input.T_world_base);
  return !is_finished_ && plan_to(input.T_world_base, search_[place_]);
}

/// From here on the path is free as far as the vehicle goes until it can turn off, and so is a circle from there, all
/// of it seen. Then that is the way out.
bool Circumnavigation::is_safe(const SegmentPath& path, double way_m, double speed_m_s) {
  const AvoidanceParams& avoidance = params_.avoidance;
  const double to_m = std::min(way_m + speed_m_s * (avoidance.reaction_s + kStep_s), path.length_m);
  if (!check(path, way_m, to_m, obstacles_, pose_sigma_m_, avoidance).free) return false;
  if (!seen_.contains(path, way_m, to_m, avoidance.clearance_m)) return false;
  const Pose2 from = place_at(path, to_m).pose;
  const double first_side = has_target_ ? -side_ : 1.0;
  for (const double side : {first_side, -first_side}) {
    clear(joined_);
    append(joined_, holding_circle(from, side, avoidance));
    if (!is_free(joined_) || !seen_.contains(joined_, 0.0, joined_.length_m, avoidance.clearance_m)) continue;
    clear(way_out_);
    append_part(way_out_, path, way_m, to_m);
    append(way_out_, joined_.segments[0]);
    return true;
  }
  return false;
}

void Circumnavigation::hold() {
  // To turn off from a path counts, too: it may be found again and again.
  if (!holds_ && !path_.segments.empty() && missing_.empty()) held_s_ += kTurnOff_s;
  holds_ = true;
  planned_ns_ = now_ns_;
  if (way_out_.segments.empty()) {
    clear(path_);
  } else {
    std::swap(path_, way_out_);
    clear(way_out_);
  }
  way_m_ = 0.0;
  ++step_.path_number;
}

/// Of a path that ends with a full circle: how far on it is free, infinite if the whole circle is.
double Circumnavigation::free_on_circle_m(const SegmentPath& path, double way_m) const {
  const PathCheck ahead = check(path, way_m, path.length_m, obstacles_, pose_sigma_m_, params_.avoidance);
  if (!ahead.free) return ahead.free_m - way_m;
  const double circle_m = path.length_m - length_m(path.segments.back());
  if (circle_m >= way_m) return kInfinite;
  const PathCheck again = check(path, circle_m, way_m, obstacles_, pose_sigma_m_, params_.avoidance);
  return again.free ? kInfinite : path.length_m - way_m + again.free_m - circle_m;
}

/// To the circle that is free as a whole, by a short way and seen, if there is one; else to that which is free
/// farthest, if that is farther than `least_m`.
bool Circumnavigation::escape(const MissionInput& input, double least_m) {
  const AvoidanceParams& avoidance = params_.avoidance;
  const double radius_m = avoidance.turn_radius_m;
  double best_m = least_m, best_worth = -kInfinite;
  bool found = false;
  for (const double first_rad : {0.0, 0.5, -0.5, 1.0, -1.0, 1.6, -1.6}) {
    for (const double straight_m : {0.0, 0.5 * radius_m, radius_m, 2.0 * radius_m}) {
      for (const double side : {1.0, -1.0}) {
        clear(joined_);
        Pose2 from = input.T_world_base;
        if (first_rad != 0.0) {
          Arc turn = holding_circle(from, std::copysign(1.0, first_rad), avoidance);
          turn.sweep_rad = first_rad;
          append(joined_, turn);
          from = place_at(joined_, joined_.length_m).pose;
        }
        if (straight_m > 0.0) {
          append(joined_, Straight{from.translation_m, from * Eigen::Vector2d(straight_m, 0.0), from.yaw_rad});
          from = place_at(joined_, joined_.length_m).pose;
        }
        append(joined_, holding_circle(from, side, avoidance));
        const double free_m = free_on_circle_m(joined_, 0.0);
        if (free_m < kInfinite && (best_m == kInfinite || free_m <= best_m)) continue;
        double worth = 0.0;
        if (free_m == kInfinite) {
          const bool is_seen = seen_.contains(joined_, 0.0, joined_.length_m, avoidance.clearance_m);
          worth = (is_seen ? 1e6 : 0.0) - joined_.length_m;
          if (best_m == kInfinite && worth <= best_worth) continue;
        }
        best_m = free_m;
        best_worth = worth;
        std::swap(tried_, joined_);
        found = true;
      }
    }
  }
  if (!found) return false;
  std::swap(path_, tried_);
  way_m_ = 0.0;
  ++step_.path_number;
  return true;
}

/// Keeps on the circle while it is free, all of it.
void Circumnavigation::turn_on(const MissionInput& input) {
  if (!path_.segments.empty() && path_.length_m - way_m_ < 0.1) {
    // The same circle again.
    const DubinsPlace place = place_at(path_, path_.length_m);
    clear(joined_);
    append(joined_, holding_circle(place.pose, place.curvature_1_m < 0.0 ? -1.0 : 1.0, params_.avoidance));
    std::swap(path_, joined_);
    way_m_ = 0.0;
    ++step_.path_number;
  }
  const double free_m = path_.segments.empty() ? -1.0 : free_on_circle_m(path_, way_m_);
  if (free_m < kInfinite) escape(input, free_m + 1.0);
}

}  // namespace situation_awareness

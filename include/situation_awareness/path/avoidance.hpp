// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstddef>
#include <limits>
#include <vector>

#include "situation_awareness/common/params.hpp"
#include "situation_awareness/path/dubins.hpp"
#include "situation_awareness/path/obstacles.hpp"
#include "situation_awareness/path/segment_path.hpp"

namespace situation_awareness {

// Avoidance (docs/math/circumnavigation.md; splinegon paper, Sect. II-B): whether a path keeps its distance from all
// obstacles, and a way around. All in the world, lengths in m.

struct AvoidanceParams {
  double clearance_m = 3.0;
  double sigmas = 3.0;
  double turn_radius_m = 7.5;
  double reaction_s = 0.5;
  double braking_m_s2 = 0.0;

  template <class Self, class Visit>
  static void fields(Self& self, Visit&& visit) {
    visit("clearance_m", self.clearance_m, Bounds{0.0, 1000.0}, "m", "least distance of a path from obstacles");
    visit("sigmas", self.sigmas, Bounds{0.0, 10.0}, "",
          "standard deviations of obstacle and pose that are added to the clearance");
    visit("turn_radius_m", self.turn_radius_m, Bounds{0.01, 10000.0}, "m",
          "radius of the turns that are planned: the vehicle's least one with a reserve for following and wind");
    visit("reaction_s", self.reaction_s, Bounds{0.0, 10.0}, "s", "time from a decision until the vehicle turns so");
    visit("braking_m_s2", self.braking_m_s2, Bounds{0.0, 20.0}, "m/s^2",
          "deceleration to a stop that is sure; 0: the vehicle cannot stop");
  }

  /// Throws std::invalid_argument naming field and bound.
  void validate() const;
};

/// The way that a vehicle goes on at least: that of its reaction, and of a stop; if it cannot stop, that of a turn by a
/// right angle, after which it comes no nearer to a wall across its way.
double stopping_way_m(double speed_m_s, const AvoidanceParams& params);

/// How near a path may come to a piece of an obstacle, with this standard deviation of the vehicle's position.
double margin_m(const ObstaclePiece& piece, double pose_sigma_m, const AvoidanceParams& params);

struct PathCheck {
  bool free = true;
  double free_m = 0.0;  ///< way from the path's begin to where it comes too near to an obstacle, or to the end
  std::size_t piece = ObstaclePiece::kNone;  ///< which it is
};

/// Whether the path is free between two ways. It is computed, not sampled, in time linear in the pieces times the
/// segments. Where the vehicle already is nearer to a piece than its margin at `from_m`, the path may come no nearer.
/// Allocates nothing.
PathCheck check(const SegmentPath& path, double from_m, double to_m, const Obstacles& obstacles, double pose_sigma_m,
                const AvoidanceParams& params);

/// The least distance of a path from obstacles, their standard deviations left aside; infinite without any.
double clearance_m(const SegmentPath& path, const Obstacles& obstacles);

/// A full circle from a pose, to the left (+1) or right (-1), with the radius of planned turns.
Arc holding_circle(const Pose2& from, double side, const AvoidanceParams& params);

/// A free path from a pose to an end: the shortest Dubins path, else the shortest of those by an intermediate pose
/// beside the place at which that comes too near. False, and an empty path, if there is none.
bool plan_around(const Pose2& from, const DubinsEnd& to, const Obstacles& obstacles, double pose_sigma_m,
                 const AvoidanceParams& params, SegmentPath& path);

}  // namespace situation_awareness

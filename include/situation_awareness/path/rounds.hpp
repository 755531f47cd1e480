// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstddef>
#include <vector>

#include <Eigen/Core>

#include "situation_awareness/common/params.hpp"
#include "situation_awareness/geometry/angles.hpp"
#include "situation_awareness/path/dubins.hpp"
#include "situation_awareness/path/dubins_following.hpp"

namespace situation_awareness {

struct RoundsParams {
  double laps = 1.3;
  double radius_m = 8.0;

  template <class Self, class Visit>
  static void fields(Self& self, Visit&& visit) {
    visit("laps", self.laps, Bounds{0.1, 1000.0}, "", "how often around each circle");
    visit("radius_m", self.radius_m, Bounds{0.1, 1e4}, "m", "of the first turn, on the way to the first circle");
  }

  /// Throws std::invalid_argument naming field and bound.
  void validate() const { check_bounds(*this, "rounds"); }
};

/// A scripted flight in place of a mission: to the first circle, around it counter-clockwise, to the next, on Dubins
/// paths. After the last it goes on around that.
class Rounds {
 public:
  /// `circles`: centre x, y and radius, in m. Throws std::invalid_argument for params, without a circle, and for one
  /// that is tighter than 1 / max_curvature.
  Rounds(const std::vector<Eigen::Vector3d>& circles, const RoundsParams& params, double max_curvature_1_m);

  /// The turn rate for a vehicle that is there and moves over the ground as its yaw says.
  double turn_rate(const Pose2& T_world_course, double speed_m_s);

  /// What is flown now; not before the first turn_rate().
  const DubinsPath& path() const { return path_; }
  /// Number of paths so far.
  std::size_t paths() const { return paths_; }
  bool done() const { return done_; }

 private:
  void plan_way(const Pose2& from);
  void plan_round();

  std::vector<Eigen::Vector3d> circles_;
  RoundsParams params_;
  DubinsFollowingParams following_;
  std::size_t circle_ = 0, paths_ = 0;
  double entry_rad_ = 0.0;  ///< on the circle
  bool around_ = false, done_ = false;
  DubinsPath path_;
  double way_m_ = 0.0;
};

}  // namespace situation_awareness

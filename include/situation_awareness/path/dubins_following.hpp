// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include "situation_awareness/common/params.hpp"
#include "situation_awareness/path/dubins.hpp"
#include "situation_awareness/path/path_following.hpp"

namespace situation_awareness {

// Following a Dubins path with a vehicle that drives on and turns no tighter than its radius (docs/math/dubins.md).

/// Parameters of following a Dubins path. The vehicle's radius is 1 / max_curvature_1_m.
struct DubinsFollowingParams {
  double max_curvature_1_m = 1.0 / 6.0;
  double reaction_s = 0.0;
  double airspeed_m_s = 0.0;

  template <class Self, class Visit>
  static void fields(Self& self, Visit&& visit) {
    visit("max_curvature_1_m", self.max_curvature_1_m, Bounds{1e-4, 100.0}, "1/m", "greatest curvature of the vehicle");
    visit("reaction_s", self.reaction_s, Bounds{0.0, 5.0}, "s",
          "time from a command until the vehicle turns so; the path's curvature is commanded ahead by it");
    visit("airspeed_m_s", self.airspeed_m_s, Bounds{0.0, 1000.0}, "m/s",
          "of a vehicle that is carried by the wind and turns its heading; 0: one that turns its course itself");
  }

  /// Throws std::invalid_argument naming field and bound.
  void validate() const;
};

/// Whether a path has no turn tighter than a maximal curvature, those without length aside.
bool may_follow(const DubinsPath& path, double max_curvature_1_m);

/// The place along the path, in [from_m, to_m], that is nearest to a point; the first one of equally near ones.
double nearest_m(const DubinsPath& path, const Eigen::Vector2d& p_m, double from_m, double to_m);

/// What a vehicle on a path is told.
struct DubinsFollowingResult {
  double curvature_1_m = 0.0;  ///< rate of turn to command over the speed, left positive, as the vehicle can turn
  double way_m = 0.0;          ///< along the path, of the reference
  FollowingError error;        ///< against the reference
  bool arrived = false;        ///< the vehicle is beside the end of the path or beyond
};

/// The curvature to turn with at a pose. The reference is the nearest point of the path, at most half a radius beyond
/// the one before, `way_m`, which is 0 at the begin; it never goes back, so that a path that crosses itself is followed
/// in its order. Beyond the end the path goes straight on. `speed_m_s` >= 0, over ground, counts with a reaction time
/// or an airspeed only.
DubinsFollowingResult follow(const DubinsPath& path, const DubinsFollowingParams& params, const Pose2& T_world_base,
                             double speed_m_s, double way_m);

}  // namespace situation_awareness

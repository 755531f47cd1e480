// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstdint>
#include <optional>
#include <utility>
#include <vector>

#include <Eigen/Core>

#include "situation_awareness/common/random.hpp"
#include "situation_awareness/map/polygons/polygons.hpp"
#include "situation_awareness/path/path_following.hpp"
#include "situation_awareness/path/safety_areas.hpp"
#include "situation_awareness/points/points.hpp"

namespace situation_awareness {

// A vehicle that follows a path through a corridor at the speed that its safety areas allow, simulated in the plane of
// its scanner: rays cast on walls, boxes and legs, noise, latency and braking included (docs/math/path.md).

/// Someone who crosses the way. Legs are seen; the vehicle must not touch the circle about both.
struct Walker {
  static constexpr double kRadius_m = 0.18;
  static constexpr double kLegRadius_m = 0.06;

  Eigen::Vector2d from_m = Eigen::Vector2d::Zero();
  Eigen::Vector2d to_m = Eigen::Vector2d::Zero();
  double speed_m_s = 1.0;
  double begin_s = 0.0;     ///< stands before
  double pause_at_m = 1e9;  ///< of its way, where it stands for
  double pause_s = 0.0;     ///< this time
};

/// A corridor along x, with what stands in it.
struct TransitScene {
  double length_m = 12.0;  ///< of the path, on its middle
  double half_width_m = 1.6;
  std::vector<Box> known_boxes;  ///< on the map since before the transit, as the walls are
  std::vector<Box> new_boxes;    ///< not on the map
  std::optional<Walker> walker;
};

/// The vehicle and the scanner, for a LMS100: 270 deg, 0.5 deg, 25 Hz, 12 mm.
struct TransitParams {
  VehicleParams vehicle;
  SafetyParams safety;
  PathFollowingParams path;
  double range_sigma_m = 0.012;
  double lost_share = 0.002;
  double sweep_s = 0.03;
  double least_latency_s = 0.02;  ///< from the last beam until the vehicle obeys
  double most_latency_s = 0.06;
  double pose_sigma_m = 0.003;
  double pose_sigma_rad = 0.001;
  double longest_s = 120.0;
};

struct TransitOutcome {
  bool arrived = false;
  double time_s = 0.0;
  bool touched = false;            ///< the walker, by the vehicle that moved
  double touch_speed_m_s = 0.0;    ///< of the vehicle then
  double least_clearance_m = 1e9;  ///< between the walker and the vehicle that moved
  double least_speed_m_s = 1e9;    ///< after the start and before the end
  bool hit_box = false;            ///< the vehicle touched a box or a wall
};

/// One transit; the same seed gives the same one.
TransitOutcome simulate_transit(const TransitScene& scene, const TransitParams& params, std::uint64_t seed);

/// Three boxes beside the way, within the warning area.
TransitScene scene_with_boxes(std::uint64_t seed);

/// Someone who steps into the way from a side, in view for the whole time; with `behind_a_box` from behind a known box.
TransitScene scene_with_walker(std::uint64_t seed, bool behind_a_box = false);

}  // namespace situation_awareness

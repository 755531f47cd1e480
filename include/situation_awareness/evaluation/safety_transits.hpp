// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstdint>
#include <optional>
#include <utility>
#include <vector>

#include <Eigen/Core>

#include "situation_awareness/common/random.hpp"
#include "situation_awareness/map/map.hpp"
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

/// What fails during a transit, from some time on.
enum class TransitFault : std::uint8_t {
  kNone,
  kNoScan,           ///< no more scans
  kFrozenScan,       ///< the same ranges with new stamps
  kLateScan,         ///< by 1 s
  kNoReturn,         ///< no beam has a return
  kNanScan,          ///< no beam says anything
  kNoObjects,        ///< a map whose objects are no more brought up to date, or never were
  kFrozenMap,        ///< the same map with new stamps
  kNoMap,            ///< no more maps
  kWrongMap,         ///< a known chain along the way of who crosses
  kNoCovariance,     ///< no more of them
  kNanCovariance,    ///< all of it
  kInfCovariance,    ///< the variances
  kMinusCovariance,  ///< the variances are -1
  kLargeCovariance,  ///< sigmas of 1 m and 1 rad
  kNoOdometry,       ///< no more speeds
  kNanOdometry,      ///< speeds of NaN
  kNoPose,           ///< no more transforms: scans cannot be placed
  kNoVerdict,        ///< the safety areas are gone
  kCrash,            ///< nobody commands any more: the base stops by its own watchdog
};
constexpr int kTransitFaults = 20;

/// "no scan", ...
const char* name_of(TransitFault fault);

/// Whether the vehicle has to stand after it.
bool has_to_stop(TransitFault fault);

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
  TransitFault fault = TransitFault::kNone;
  double fault_s = 0.0;     ///< when; 0: from the start
  double watchdog_s = 0.1;  ///< of the base, which then brakes
};

struct TransitOutcome {
  bool arrived = false;
  double time_s = 0.0;
  bool touched = false;            ///< the walker, by the vehicle that moved
  double touch_speed_m_s = 0.0;    ///< of the vehicle then, and
  double touch_in_view_s = 0.0;    ///< for how long the scanner had had the walker in view
  double least_clearance_m = 1e9;  ///< between the walker and the vehicle that moved
  double least_speed_m_s = 1e9;    ///< after the start and before the end
  bool hit_box = false;            ///< the vehicle touched a box or a wall
  bool found = false;              ///< the fault: the first command after it that says so is to brake for it
  double found_after_s = 0.0;
  double found_speed_m_s = 0.0;
  double way_to_stand_m = 0.0;  ///< driven since then
  bool stands = false;          ///< at the end
};

/// One transit; the same seed gives the same one.
TransitOutcome simulate_transit(const TransitScene& scene, const TransitParams& params, std::uint64_t seed);

/// The longest way on which a vehicle stands once a fault is found: reaction and braking distance. Commands of before
/// are under way meanwhile, by which one that has just set off still gets faster, up to the scan after.
double longest_way_to_stand_m(const TransitOutcome& outcome, const TransitParams& params);

/// Three boxes beside the way, within the warning area.
TransitScene scene_with_boxes(std::uint64_t seed);

/// Returns the time in which the vehicle stands from its full speed, once it has to.
double longest_time_to_stand_s(const VehicleParams& vehicle);

/// Someone who steps into the way from a side, beside a known box or where there is none. They are in view of the
/// scanner for longest_time_to_stand_s() before they may touch the vehicle, however it drives and they walk meanwhile:
/// scenes are drawn until this holds. Those in which it does not are appended to `out_of_hiding`.
TransitScene scene_with_walker(std::uint64_t seed, const VehicleParams& vehicle = {},
                               std::vector<TransitScene>* out_of_hiding = nullptr);

/// Someone who steps out from behind a known box.
TransitScene scene_with_walker_behind_a_box(std::uint64_t seed);

/// A known box beside the end of the way, where the vehicle turns to drive back.
TransitScene scene_with_box_at_the_end(std::uint64_t seed);

/// Of a Pioneer, of a vehicle with 0.6 m behind its axle, and of one of 1.1 m x 0.7 m.
Footprint footprint_of_shape(std::size_t shape);
constexpr std::size_t kShapes = 3;

/// Someone who steps into the way, in view, of a vehicle of one of the shapes, and a fault at some time, all by the
/// seed. The shapes take turns, and begin with the next one each 10,000 seeds: where policies take turns, too, each
/// meets another shape then.
struct TransitWithFault {
  TransitScene scene;
  std::vector<TransitScene> out_of_hiding;  ///< scenes that were drawn before, in which they are not in view in time
  TransitParams params;
};
TransitWithFault transit_with_fault(SafetyPolicy policy, std::uint64_t seed);

}  // namespace situation_awareness

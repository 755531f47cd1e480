// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstddef>
#include <cstdint>
#include <utility>
#include <vector>

#include <Eigen/Core>

#include "situation_awareness/common/stamp_order.hpp"
#include "situation_awareness/map/polygons/chain_state.hpp"
#include "situation_awareness/map/polygons/map_snapshot.hpp"
#include "situation_awareness/map/polygons/movers.hpp"
#include "situation_awareness/map/polygons/polygon_map.hpp"
#include "situation_awareness/map/polygons/polygons.hpp"
#include "situation_awareness/polylines/polylines.hpp"

namespace situation_awareness {

/// Whether all numbers are finite and of a place within 1000 km of the world's origin.
bool can_be_mapped(const Polylines& polylines, const Eigen::Matrix3d& pose_covariance);

/// The map of polygons of a program that runs for long: a PolygonMap with the states of its chains, with restarts of
/// time, transits, reset and loaded maps. A transit is what lies between two gaps of `absence_s` in the scans, and
/// after loading a map.
class TimedPolygonMap {
 public:
  static constexpr std::int64_t kNoStamp = StampOrder::kNone;
  /// The reasons counted for a scan that is not used.
  static constexpr const char* kRepeats = "stamp repeats";
  static constexpr const char* kGoesBack = "stamp goes back";
  static constexpr const char* kAnotherTime = "stamp of another time";
  static constexpr const char* kCannotBeUsed = "scan with numbers that cannot be used";

  /// Stamps that go back by more than `reset_time_jump_s` begin a new map (StampOrder). Throws std::invalid_argument
  /// naming field and bound.
  TimedPolygonMap(const PolygonMapParams& params, const ChainStateParams& states, double reset_time_jump_s);

  /// As StampOrder::trust, where another has judged the stamps.
  void trust_stamps() { order_.trust(); }

  /// As PolygonMap::update. A scan with another number than finite ones, or farther than 1000 km from the world's
  /// origin, and one whose stamp is not in order (StampOrder) are not used: the reason is counted, and stamp_ns()
  /// stays.
  PolygonMapUpdate update(const Polylines& polylines, const Eigen::Matrix3d& pose_covariance,
                          PolygonMapUpdate memory = {}) {
    return update(polylines, pose_covariance, Movers{}, std::move(memory));
  }

  /// The same without what moves.
  PolygonMapUpdate update(const Polylines& polylines, const Eigen::Matrix3d& pose_covariance, const Movers& movers,
                          PolygonMapUpdate memory = {});

  /// The chains as of the latest update, by ascending id; those that PolygonMap::update_due_chains() leaves as they are
  /// as of an earlier one.
  const Polygons& polygons() const { return polygons_; }

  /// Stamp of the latest update, kNoStamp before the first.
  std::int64_t stamp_ns() const { return order_.latest_ns(); }

  /// Number of elements of their boundaries.
  std::size_t elements() const { return map_.elements(); }

  /// Number of chains.
  std::size_t size() const { return polygons_.chains.size(); }

  /// The chains at a time from the latest update on: what stands is where it is.
  Polygons at(std::int64_t stamp_ns) const;

  /// Deletes the map and its time. Ids are not used again.
  void reset();

  /// The whole state, for which all chains are made; `world_frame` is left empty.
  PolygonMapSnapshot snapshot();

  /// Continues from a state that may be of another time: a scan that comes within `absence_s` after it goes on bit for
  /// bit as in the map that was saved. Times of a state that is later than the running map's, or than the next scan,
  /// are moved to before that. Throws std::invalid_argument as PolygonMap::restore; the map is then unchanged.
  void resume(const PolygonMapSnapshot& snapshot);

 private:
  void begin_anew();
  void shift_to(std::int64_t stamp_ns);
  void make_polygons(std::int64_t stamp_ns, const ChainChanges& changes);

  PolygonMapParams params_;
  ChainStateParams states_;
  StampOrder order_;
  PolygonMap map_;
  Polygons polygons_;
  std::vector<Chain> spare_;                   ///< for their memory
  std::int64_t judged_transit_ns_ = kNoStamp;  ///< transit_ns_ when their states were judged
  std::vector<std::uint64_t> new_;             ///< ids of those that are new, in ascending order
  std::int64_t map_stamp_ns_ = kNoStamp;       ///< of map_
  std::int64_t transit_ns_ = kNoStamp;         ///< begin of the present transit
  bool resumed_ = false;                       ///< and not updated since
};

}  // namespace situation_awareness

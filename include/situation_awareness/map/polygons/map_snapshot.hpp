// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstddef>
#include <cstdint>
#include <limits>
#include <string>
#include <vector>

#include <Eigen/Core>

#include "situation_awareness/common/params.hpp"
#include "situation_awareness/geometry/pose2.hpp"
#include "situation_awareness/map/map_fields.hpp"
#include "situation_awareness/map/polygons/joints.hpp"
#include "situation_awareness/map/polygons/polygons.hpp"

namespace situation_awareness {

/// Bounds of the numbers in a map of polygons.
namespace polygon_bounds {
constexpr Bounds kPosition_m{-1e6, 1e6};
constexpr Bounds kUnit{-1.000001, 1.000001};
constexpr Bounds kVariance_m2{1e-12, 1e9};
constexpr Bounds kExtent_m{-100.0, 100.0};
constexpr Bounds kSize_m{0.0, 1e7};
constexpr Bounds kLogOdds{-100.0, 100.0};
constexpr Bounds kDuration_s{0.0, 1e9};
constexpr std::int64_t kEnd_ns = (std::int64_t{1} << 32) * 1'000'000'000;  ///< stamps are from 1970 to 2106, as in ROS
constexpr std::int64_t kMaxAge_ns = std::int64_t{1} << 61;                 ///< 73 years
constexpr std::uint64_t kMaxId = std::uint64_t{1} << 53;
constexpr std::size_t kMaxElements = 300'000;  ///< of a map: no more are made; of 4 cm: 12 km of boundary, 140 MB
constexpr std::int64_t kMaxPlace = 1 << 24;    ///< elements of the map, removed ones included
}  // namespace polygon_bounds

struct FloatRow {
  std::vector<float> values;
};
struct PlaceRow {
  std::vector<std::int32_t> values;
};
/// Elements that are linked, by their places, from right to left.
struct ChainPlaces {
  std::uint64_t id = 0;  ///< of their chain; 0: it is not shown
  bool closed = false;
  bool loop = false;          ///< each of them follows another one: it is listed after those that are not
  std::int32_t begun_at = 0;  ///< place of the element by which it is listed
  std::vector<std::int32_t> elements;
};
struct ChainRows {
  std::vector<ChainPlaces> values;
};

/// An element of a boundary, as PolygonMap keeps it.
struct PolygonMapElement {
  std::int64_t place = 0;  ///< in the map's memory
  Eigen::Vector2d p_world_m = Eigen::Vector2d::Zero();
  Eigen::Vector2d normal_world = Eigen::Vector2d::UnitX();
  double variance_m2 = 1.0;
  double low_m = 0.0, high_m = 0.0;
  double log_odds = 0.0;
  double seen_s = 0.0;
  std::int64_t first_seen_ns = 0, last_seen_ns = 0;
  int hits = 0;
  std::uint64_t chain = 0;
  int elements_of_chain = 0;
  double thing_m = 0.0;
  bool oriented = false, confirmed = false, watched = false;

  /// The state that an element of the map and this have in common: the only list of it (map/map_fields.hpp).
  template <class Self, class Visit>
  static void state_fields(Self& self, Visit&& visit) {
    using namespace polygon_bounds;
    visit("p_world", self.p_world_m, kPosition_m);
    visit("normal_world", self.normal_world, kUnit);
    visit("variance_m2", self.variance_m2, kVariance_m2);
    visit("low_m", self.low_m, kExtent_m);
    visit("high_m", self.high_m, kExtent_m);
    visit("log_odds", self.log_odds, kLogOdds);
    visit("seen_s", self.seen_s, kDuration_s);
    visit("first_seen_ns", self.first_seen_ns, -kMaxAge_ns, kEnd_ns);
    visit("last_seen_ns", self.last_seen_ns, -kMaxAge_ns, kEnd_ns);
    visit("hits", self.hits);
    visit("chain", self.chain, 0, kMaxId);
    visit("elements_of_chain", self.elements_of_chain, 0, kMaxPlace);
    visit("thing_m", self.thing_m, kSize_m);
    visit("oriented", self.oriented);
    visit("confirmed", self.confirmed);
    visit("watched", self.watched);
  }

  template <class Self, class Visit>
  static void fields(Self& self, Visit&& visit) {
    visit("place", self.place, 0, polygon_bounds::kMaxPlace);
    state_fields(self, visit);
  }
};

/// Whether these can be of a scan's FreeSpace: as many ranges as azimuths, which ascend, and all of them numbers.
bool is_free_space(const std::vector<float>& azimuth_rad, const std::vector<float>& range_m);

/// What was free in a remembered scan; without ranges: none is remembered.
struct PolygonMapWatch {
  std::int64_t stamp_ns = 0;
  Pose2 T_level_world;
  FloatRow azimuth_rad, range_m;
  bool full_circle = false;

  template <class Self, class Visit>
  static void fields(Self& self, Visit&& visit) {
    visit("stamp_ns", self.stamp_ns, -polygon_bounds::kMaxAge_ns, polygon_bounds::kEnd_ns);
    visit("level_world", self.T_level_world, Bounds{-1e7, 1e7});
    visit("azimuth_rad", self.azimuth_rad);
    visit("range_m", self.range_m);
    visit("full_circle", self.full_circle);
  }
};

/// The whole state of a PolygonMap after an update, sufficient to continue from it bit for bit.
struct PolygonMapSnapshot {
  static constexpr std::int64_t kNoStamp = -1;
  static constexpr std::size_t kMaxWatches = 64;
  static constexpr std::size_t kMaxJoints = 100'000;

  std::int64_t stamp_ns = kNoStamp;  ///< of the latest update
  double step_s = 0.0;               ///< time for which scans were added since the chains were made
  double height_world_m = 0.0;       ///< of the scans, for users of the snapshot
  std::uint64_t next_id = 1;         ///< id of the next new chain: larger than all used before
  PlaceRow free_places;              ///< of removed elements, in the order of their removal
  std::int64_t next_watch = 0;       ///< which of the watches is overwritten next
  std::vector<PolygonMapWatch> watches;
  std::int64_t joined_at_ns = kNoStamp;  ///< of the latest scan that the joints saw
  std::vector<Joints::Joint> joints;     ///< in ascending order
  PlaceRow met_joints;                   ///< those of the joints that met since they were decided
  /// The chains that the elements make, each element of one at most. If there are none, elements are linked anew.
  ChainRows chains;
  PlaceRow seldom_hit;  ///< places of elements on the map that are not shown, as seldom as they were hit
  PlaceRow crossed;     ///< the same of those with one near them that faces quite another way
  PlaceRow renamed;     ///< the same of those that got the id of another chain in the latest update
  PlaceRow lines;  ///< of elements that follow each other along a line, from right to left, each with a -1 behind it
  std::vector<PolygonMapElement> elements;  ///< in an order in which they can be inserted into the map's grid

  /// Every field but elements and polygons.
  template <class Self, class Visit>
  static void fields(Self& self, Visit&& visit) {
    using namespace polygon_bounds;
    visit("stamp_ns", self.stamp_ns, kNoStamp, kEnd_ns);
    visit("step_s", self.step_s, kDuration_s);
    visit("height_world_m", self.height_world_m, kPosition_m);
    visit("next_id", self.next_id, 1, kMaxId);
    visit("free_places", self.free_places);
    visit("next_watch", self.next_watch, 0, static_cast<std::int64_t>(kMaxWatches));
    visit("watches", self.watches, kMaxWatches);
    visit("joined_at_ns", self.joined_at_ns, kNoStamp, kEnd_ns);
    visit("joints", self.joints, kMaxJoints);
    visit("met_joints", self.met_joints);
    visit("chains", self.chains);
    visit("seldom_hit", self.seldom_hit);
    visit("crossed", self.crossed);
    visit("renamed", self.renamed);
    visit("lines", self.lines);
  }

  /// Throws std::invalid_argument naming element and field if the snapshot is invalid: a number that is not finite or
  /// out of bounds, a normal that is no unit vector, places that are not each of one element or free, a chain that is
  /// not below `next_id`, joints that are not in ascending order, chains that are not of elements on the map, each of
  /// one at most, or have the same id, a stamp after the latest update, free space that is not one range for each of
  /// ascending azimuths.
  void validate() const;
};

/// A map of these chains: elements `spacing_m` apart along their edges, linked and confirmed, as certain as the chains
/// are. Throws std::invalid_argument as PolygonMapSnapshot::validate.
PolygonMapSnapshot snapshot_of_chains(const Polygons& polygons, double spacing_m);

}  // namespace situation_awareness

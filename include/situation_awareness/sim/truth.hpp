// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstdint>
#include <limits>
#include <vector>

#include <Eigen/Core>

#include "situation_awareness/map/objects/objects.hpp"
#include "situation_awareness/sim/world.hpp"

namespace situation_awareness {

/// Hits farther away do not count in the truth: the papers' range of interest.
constexpr double kTruthRange_m = 10.0;

/// True hit of a ray, without noise.
struct TrueHit {
  int object = -1;  ///< index of an object in the world's order; -1: none, or none within the range that counts
  double range_m = std::numeric_limits<double>::infinity();  ///< to the object
  Eigen::Vector2d p_object_m = Eigen::Vector2d::Zero();      ///< the place hit, in the frame of the object's body
};

/// Counts of the hits of scans on a world's objects.
class Sightings {
 public:
  struct Sighting {
    int beams = 0;         ///< that hit the object in the latest scan
    int observations = 0;  ///< scans that hit it
    std::int64_t first_seen_ns = 0, last_seen_ns = 0;
  };

  /// Hits farther away than `range_m` do not count.
  explicit Sightings(std::size_t objects, double range_m = kTruthRange_m) : range_m_(range_m), of_object_(objects) {}

  /// Add a scan: `hits` are rows of `columns` rays, one row for a 2D scanner. The row with the most hits on an
  /// object counts for it, so that the number of rows has no effect: rows of a tilted scanner see what is between two
  /// occlusions in different columns. Returns for each ray the object it counts for, or -1.
  std::vector<int> add(std::int64_t stamp_ns, const std::vector<TrueHit>& hits, std::size_t columns);

  const std::vector<Sighting>& of_object() const { return of_object_; }

 private:
  double range_m_;
  std::vector<Sighting> of_object_;
};

/// The indices in `World::names()` of the objects of `true_map`, which are the elliptic cylinders.
std::vector<std::size_t> objects_of_true_map(const World& world);

/// The truth as a map of ellipses: the objects at that time that are elliptic cylinders, with exact velocities, without
/// covariance, and with the counts of their hits so far. p_exists is 1, or 0 for absent objects, so that every time has
/// the same objects in the same order. `height_world_m` is that of the map.
Objects true_map(const World& world, const Sightings& sightings, double time_s, double height_world_m);

}  // namespace situation_awareness

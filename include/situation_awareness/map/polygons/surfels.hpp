// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cmath>
#include <cstddef>
#include <cstdint>
#include <vector>

#include <Eigen/Core>

namespace situation_awareness {

/// An oriented element of a boundary (surface element; Keller et al., 2013), with what is known of its existence.
struct Surfel {
  Eigen::Vector2d p_world_m = Eigen::Vector2d::Zero();
  Eigen::Vector2d normal_world = Eigen::Vector2d::UnitX();  ///< unit, towards the free side
  double variance_m2 = 0.0;                                 ///< across, of range noise and pose; above zero
  std::uint64_t chain = 0;                                  ///< id of the chain that it is named after; 0: none yet
  int hits = 0;
  bool oriented = false;                             ///< by a hit with a normal; else the normal is along the beam
  bool alive = false;                                ///< else its place in the list is free
  bool confirmed = false;                            ///< on the map
  bool watched = false;                              ///< it came while its place was seen to be free
  double low_m = 0.0, high_m = 0.0;                  ///< extent of its hits along it, from right to left
  double log_odds = 0.0;                             ///< of its existence
  double seen_s = 0.0;                               ///< time for which it was hit
  std::int64_t first_seen_ns = 0, last_seen_ns = 0;  ///< stamps of scans that hit it
  int elements_of_chain = 0;                         ///< of the one that it is of now; 0: it is not shown
  double thing_m = 0.0;                              ///< size of the largest one that it was of when it was hit

  /// Unit, from right to left as seen from the free side.
  Eigen::Vector2d along_world() const { return {normal_world.y(), -normal_world.x()}; }
};

/// The elements of a map, found by their place. Indices are reused.
class Surfels {
 public:
  using Index = std::int32_t;
  static constexpr Index kNone = -1;

  /// `cell_m`: of the grid, about the radius of most searches.
  explicit Surfels(double cell_m) : cell_m_(cell_m), buckets_(kBuckets, kNone) {}

  Surfel& operator[](Index index) { return surfels_[static_cast<std::size_t>(index)]; }
  const Surfel& operator[](Index index) const { return surfels_[static_cast<std::size_t>(index)]; }

  /// One more than the greatest index, those not alive included.
  Index end() const { return static_cast<Index>(surfels_.size()); }
  std::size_t count() const { return surfels_.size() - free_.size(); }

  Index add(const Surfel& surfel);
  void remove(Index index);
  void move(Index index, const Eigen::Vector2d& p_world_m);

  /// Free places among the indices, in the order in which they became free.
  const std::vector<Index>& free_places() const { return free_; }
  /// All elements, in an order in which put() makes the same list of them.
  std::vector<Index> in_order() const;
  /// Empties the list, and makes room for so many elements beside these free places.
  void begin(std::size_t elements, const std::vector<Index>& free_places);
  /// An element in its place, one of those after begin() that are neither free nor taken.
  void put(Index index, const Surfel& surfel);

  /// act(index, surfel) for all within `radius_m` along x and y, and some beyond, up to the corners of that square.
  /// `act` adds, moves and removes none.
  template <class Act>
  void for_each_near(const Eigen::Vector2d& p_world_m, double radius_m, const Act& act) const {
    const std::int32_t x_low = cell_of(p_world_m.x() - radius_m), x_high = cell_of(p_world_m.x() + radius_m);
    const std::int32_t y_low = cell_of(p_world_m.y() - radius_m), y_high = cell_of(p_world_m.y() + radius_m);
    const double most_m2 = 2.0 * radius_m * radius_m;
    for (std::int32_t x = x_low; x <= x_high; ++x) {
      for (std::int32_t y = y_low; y <= y_high; ++y) {
        for (Index i = buckets_[bucket(x, y)]; i != kNone;) {
          const Place& place = places_[static_cast<std::size_t>(i)];
          // Others share the bucket.
          if (place.cell_x == x && place.cell_y == y && (place.p_world_m - p_world_m).squaredNorm() <= most_m2) {
            act(i, (*this)[i]);
          }
          i = place.next;
        }
      }
    }
  }

 private:
  static constexpr std::size_t kBuckets = 1U << 14U;

  /// What a search reads of each element, apart from the rest: most of its time is for memory.
  struct Place {
    Eigen::Vector2d p_world_m = Eigen::Vector2d::Zero();
    Index next = kNone;  ///< of its cell
    std::int32_t cell_x = 0, cell_y = 0;
  };

  std::int32_t cell_of(double coordinate_m) const {
    return static_cast<std::int32_t>(std::floor(coordinate_m / cell_m_));
  }
  static std::size_t bucket(std::int32_t x, std::int32_t y) {
    const auto hash = static_cast<std::uint32_t>(x) * 73856093U ^ static_cast<std::uint32_t>(y) * 19349663U;
    return hash & (kBuckets - 1U);
  }
  void insert(Index index);
  void erase(Index index);

  double cell_m_;
  std::vector<Surfel> surfels_;
  std::vector<Place> places_;   ///< of surfels_, of those alive
  std::vector<Index> free_;     ///< places in surfels_
  std::vector<Index> buckets_;  ///< first element of each
};

}  // namespace situation_awareness

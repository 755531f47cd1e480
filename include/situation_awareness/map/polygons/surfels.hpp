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
  static constexpr double kMostLogOdds = 6.0;  ///< of the existence of any, at most

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

/// The elements of a map, found by their place: in fine cells for those beside one, and in tiles for those of an area.
/// What a search costs does not depend on how many elements there are elsewhere. Indices are reused.
class Surfels {
 public:
  using Index = std::int32_t;
  using Tile = std::int32_t;  ///< one of those in which there is, or was, an element: from 0 to tiles()
  static constexpr Index kNone = -1;

  /// `cell_m`: of the cells, about the radius of most searches for what is beside an element. `tile_m`: of the tiles.
  Surfels(double cell_m, double tile_m);

  Surfel& operator[](Index index) { return surfels_[static_cast<std::size_t>(index)]; }
  const Surfel& operator[](Index index) const { return surfels_[static_cast<std::size_t>(index)]; }

  /// One more than the greatest index, those not alive included.
  Index end() const { return static_cast<Index>(surfels_.size()); }
  std::size_t count() const { return surfels_.size() - free_.size(); }

  Index add(const Surfel& surfel);
  void remove(Index index);
  void move(Index index, const Eigen::Vector2d& p_world_m);

  /// Removes all.
  void clear();

  /// act(index, surfel) for all within `radius_m` along x and y, and some beyond, up to the corners of that square.
  /// `act` adds, moves and removes none.
  template <class Act>
  void for_each_near(const Eigen::Vector2d& p_world_m, double radius_m, const Act& act) const {
    const std::int32_t x_low = cell_of(p_world_m.x() - radius_m), x_high = cell_of(p_world_m.x() + radius_m);
    const std::int32_t y_low = cell_of(p_world_m.y() - radius_m), y_high = cell_of(p_world_m.y() + radius_m);
    const double most_m2 = 2.0 * radius_m * radius_m;
    for (std::int32_t x = x_low; x <= x_high; ++x) {
      for (std::int32_t y = y_low; y <= y_high; ++y) {
        for (Index i = buckets_[bucket(x, y, buckets_)]; i != kNone;) {
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

  std::size_t tiles() const { return tiles_.size(); }
  Tile tile_of(Index index) const { return places_[static_cast<std::size_t>(index)].tile; }

  Eigen::Vector2d middle_world_m(Tile tile) const {
    const TileList& own = tiles_[static_cast<std::size_t>(tile)];
    return tile_m_ * Eigen::Vector2d(own.x + 0.5, own.y + 0.5);
  }
  /// From the middle of a tile to its corners.
  double tile_radius_m() const { return std::sqrt(0.5) * tile_m_; }

  /// act(tile) for each that is within `radius_m` of a place, in any order.
  template <class Act>
  void for_each_tile(const Eigen::Vector2d& p_world_m, double radius_m, const Act& act) const {
    const auto tile_at = [&](double coordinate_m) {
      return static_cast<std::int32_t>(std::floor(coordinate_m / tile_m_));
    };
    const std::int32_t x_low = tile_at(p_world_m.x() - radius_m), x_high = tile_at(p_world_m.x() + radius_m);
    const std::int32_t y_low = tile_at(p_world_m.y() - radius_m), y_high = tile_at(p_world_m.y() + radius_m);
    const double places = (1.0 + x_high - x_low) * (1.0 + y_high - y_low);
    const auto is_near = [&](std::int32_t x, std::int32_t y) {
      const Eigen::Vector2d low_m = tile_m_ * Eigen::Vector2d(x, y);
      const Eigen::Vector2d nearest_m = p_world_m.cwiseMax(low_m).cwiseMin(low_m + Eigen::Vector2d(tile_m_, tile_m_));
      return (nearest_m - p_world_m).squaredNorm() <= radius_m * radius_m;
    };
    if (places > static_cast<double>(tiles_.size())) {
      for (std::size_t k = 0; k < tiles_.size(); ++k) {
        if (is_near(tiles_[k].x, tiles_[k].y)) act(static_cast<Tile>(k));
      }
      return;
    }
    for (std::int32_t x = x_low; x <= x_high; ++x) {
      for (std::int32_t y = y_low; y <= y_high; ++y) {
        const Tile tile = is_near(x, y) ? find_tile(x, y) : kNone;
        if (tile != kNone) act(tile);
      }
    }
  }

  /// act(tile) for those that touch a tile, with itself.
  template <class Act>
  void for_each_tile_around(Tile tile, const Act& act) const {
    const TileList& own = tiles_[static_cast<std::size_t>(tile)];
    for (std::int32_t x = own.x - 1; x <= own.x + 1; ++x) {
      for (std::int32_t y = own.y - 1; y <= own.y + 1; ++y) {
        const Tile other = find_tile(x, y);
        if (other != kNone) act(other);
      }
    }
  }

  /// act(index) for the elements of a tile, in any order. `act` adds, moves and removes none.
  template <class Act>
  void for_each_of(Tile tile, const Act& act) const {
    for (Index i = tiles_[static_cast<std::size_t>(tile)].first; i != kNone;) {
      const Index next = places_[static_cast<std::size_t>(i)].next_of_tile;
      act(i);
      i = next;
    }
  }

 private:
  /// What a search reads of each element, apart from the rest: most of its time is for memory.
  struct Place {
    Eigen::Vector2d p_world_m = Eigen::Vector2d::Zero();
    Index next = kNone;  ///< of its bucket
    std::int32_t cell_x = 0, cell_y = 0;
    Tile tile = kNone;
    Index next_of_tile = kNone, before_of_tile = kNone;
  };

  struct TileList {
    std::int32_t x = 0, y = 0;
    Index first = kNone;
    Tile next = kNone;  ///< of its bucket
  };

  std::int32_t cell_of(double coordinate_m) const {
    return static_cast<std::int32_t>(std::floor(coordinate_m / cell_m_));
  }
  static std::size_t bucket(std::int32_t x, std::int32_t y, const std::vector<Index>& buckets) {
    const auto hash = static_cast<std::uint32_t>(x) * 73856093U ^ static_cast<std::uint32_t>(y) * 19349663U;
    return hash & (buckets.size() - 1U);
  }
  Tile find_tile(std::int32_t x, std::int32_t y) const {
    Tile tile = tile_buckets_[bucket(x, y, tile_buckets_)];
    while (tile != kNone) {
      const TileList& list = tiles_[static_cast<std::size_t>(tile)];
      if (list.x == x && list.y == y) return tile;
      tile = list.next;
    }
    return kNone;
  }
  Tile tile_at(const Eigen::Vector2d& p_world_m);
  void grow_buckets();
  void insert(Index index);
  void erase(Index index);
  void enter_tile(Index index, Tile tile);
  void leave_tile(Index index);

  double cell_m_, tile_m_;
  std::vector<Surfel> surfels_;
  std::vector<Place> places_;   ///< of surfels_, of those alive
  std::vector<Index> free_;     ///< places in surfels_
  std::vector<Index> buckets_;  ///< first element of each; a power of two
  std::vector<TileList> tiles_;
  std::vector<Tile> tile_buckets_;  ///< the same of the tiles
};

}  // namespace situation_awareness

// SPDX-License-Identifier: BSD-3-Clause
#include "situation_awareness/map/polygons/surfels.hpp"

#include <algorithm>
#include <array>

#include "situation_awareness/common/usual_room.hpp"

namespace situation_awareness {
namespace {

/// Buckets at first: enough for a floor of offices.
constexpr std::size_t kFirstBuckets = 1U << 14U;
constexpr std::size_t kFirstTileBuckets = 1U << 10U;

}  // namespace

Surfels::Surfels(double cell_m, double tile_m)
    : cell_m_(cell_m), tile_m_(tile_m), buckets_(kFirstBuckets, kNone), tile_buckets_(kFirstTileBuckets, kNone) {}

/// Twice as many. The elements of a cell keep their order.
void Surfels::grow_buckets() {
  std::vector<Index> grown(2 * buckets_.size(), kNone);
  for (const Index first : buckets_) {
    std::array<Index, 2> last{kNone, kNone};  // the elements of a bucket go to two
    for (Index i = first; i != kNone;) {
      Place& place = places_[static_cast<std::size_t>(i)];
      const Index next = place.next;
      const std::size_t to = bucket(place.cell_x, place.cell_y, grown);
      const std::size_t half = to < buckets_.size() ? 0 : 1;
      (last[half] == kNone ? grown[to] : places_[static_cast<std::size_t>(last[half])].next) = i;
      place.next = kNone;
      last[half] = i;
      i = next;
    }
  }
  buckets_ = std::move(grown);
}

void Surfels::insert(Index index) {
  Place& place = places_[static_cast<std::size_t>(index)];
  place.p_world_m = (*this)[index].p_world_m;
  place.cell_x = cell_of(place.p_world_m.x());
  place.cell_y = cell_of(place.p_world_m.y());
  Index& first = buckets_[bucket(place.cell_x, place.cell_y, buckets_)];
  place.next = first;
  first = index;
}

void Surfels::erase(Index index) {
  const Place& place = places_[static_cast<std::size_t>(index)];
  Index* link = &buckets_[bucket(place.cell_x, place.cell_y, buckets_)];
  while (*link != index) link = &places_[static_cast<std::size_t>(*link)].next;
  *link = place.next;
}

/// The tile of a place; a new one where there is none.
Surfels::Tile Surfels::tile_at(const Eigen::Vector2d& p_world_m) {
  const auto x = static_cast<std::int32_t>(std::floor(p_world_m.x() / tile_m_));
  const auto y = static_cast<std::int32_t>(std::floor(p_world_m.y() / tile_m_));
  const Tile known = find_tile(x, y);
  if (known != kNone) return known;
  if (tiles_.size() >= tile_buckets_.size()) {
    tile_buckets_.assign(2 * tile_buckets_.size(), kNone);
    for (std::size_t k = 0; k < tiles_.size(); ++k) {
      Tile& first = tile_buckets_[bucket(tiles_[k].x, tiles_[k].y, tile_buckets_)];
      tiles_[k].next = first;
      first = static_cast<Tile>(k);
    }
  }
  const auto tile = static_cast<Tile>(tiles_.size());
  Tile& first = tile_buckets_[bucket(x, y, tile_buckets_)];
  tiles_.push_back({x, y, kNone, first});
  first = tile;
  return tile;
}

void Surfels::enter_tile(Index index, Tile tile) {
  Place& place = places_[static_cast<std::size_t>(index)];
  Index& first = tiles_[static_cast<std::size_t>(tile)].first;
  if (first != kNone) places_[static_cast<std::size_t>(first)].before_of_tile = index;
  place.tile = tile;
  place.before_of_tile = kNone;
  place.next_of_tile = first;
  first = index;
}

void Surfels::leave_tile(Index index) {
  const Place& place = places_[static_cast<std::size_t>(index)];
  if (place.next_of_tile != kNone) {
    places_[static_cast<std::size_t>(place.next_of_tile)].before_of_tile = place.before_of_tile;
  }
  if (place.before_of_tile != kNone) {
    places_[static_cast<std::size_t>(place.before_of_tile)].next_of_tile = place.next_of_tile;
  } else {
    tiles_[static_cast<std::size_t>(place.tile)].first = place.next_of_tile;
  }
}

Surfels::Index Surfels::add(const Surfel& surfel) {
  Index index = kNone;
  if (free_.empty()) {
    index = static_cast<Index>(surfels_.size());
    make_room(surfels_, surfels_.size() + 1);
    make_room(places_, surfels_.size() + 1);
    surfels_.push_back(surfel);
    places_.emplace_back();
    if (surfels_.size() > buckets_.size()) grow_buckets();
  } else {
    index = free_.back();
    free_.pop_back();
    (*this)[index] = surfel;
  }
  (*this)[index].alive = true;
  insert(index);
  enter_tile(index, tile_at(surfel.p_world_m));
  return index;
}

void Surfels::remove(Index index) {
  erase(index);
  leave_tile(index);
  (*this)[index].alive = false;
  free_.push_back(index);
}

void Surfels::move(Index index, const Eigen::Vector2d& p_world_m) {
  Place& place = places_[static_cast<std::size_t>(index)];
  const bool stays = cell_of(p_world_m.x()) == place.cell_x && cell_of(p_world_m.y()) == place.cell_y;
  if (!stays) erase(index);
  (*this)[index].p_world_m = place.p_world_m = p_world_m;
  if (!stays) insert(index);
  const Tile tile = tile_at(p_world_m);
  if (tile == place.tile) return;
  leave_tile(index);
  enter_tile(index, tile);
}

void Surfels::clear() {
  surfels_.clear();
  free_.clear();
  places_.clear();
  std::fill(buckets_.begin(), buckets_.end(), kNone);
  tiles_.clear();
  std::fill(tile_buckets_.begin(), tile_buckets_.end(), kNone);
}

}  // namespace situation_awareness

// SPDX-License-Identifier: BSD-3-Clause
#include "situation_awareness/map/polygons/surfels.hpp"

#include <algorithm>

namespace situation_awareness {

void Surfels::insert(Index index) {
  Place& place = places_[static_cast<std::size_t>(index)];
  place.p_world_m = (*this)[index].p_world_m;
  place.cell_x = cell_of(place.p_world_m.x());
  place.cell_y = cell_of(place.p_world_m.y());
  Index& first = buckets_[bucket(place.cell_x, place.cell_y)];
  place.next = first;
  first = index;
}

void Surfels::erase(Index index) {
  const Place& place = places_[static_cast<std::size_t>(index)];
  Index* link = &buckets_[bucket(place.cell_x, place.cell_y)];
  while (*link != index) link = &places_[static_cast<std::size_t>(*link)].next;
  *link = place.next;
}

Surfels::Index Surfels::add(const Surfel& surfel) {
  Index index = kNone;
  if (free_.empty()) {
    index = static_cast<Index>(surfels_.size());
    surfels_.push_back(surfel);
    places_.emplace_back();
  } else {
    index = free_.back();
    free_.pop_back();
    (*this)[index] = surfel;
  }
  (*this)[index].alive = true;
  insert(index);
  return index;
}

void Surfels::remove(Index index) {
  erase(index);
  (*this)[index].alive = false;
  free_.push_back(index);
}

void Surfels::move(Index index, const Eigen::Vector2d& p_world_m) {
  Place& place = places_[static_cast<std::size_t>(index)];
  const bool stays = cell_of(p_world_m.x()) == place.cell_x && cell_of(p_world_m.y()) == place.cell_y;
  if (!stays) erase(index);
  (*this)[index].p_world_m = place.p_world_m = p_world_m;
  if (!stays) insert(index);
}

std::vector<Surfels::Index> Surfels::in_order() const {
  std::vector<Index> result;
  result.reserve(count());
  for (const Index first : buckets_) {
    const auto begin = static_cast<std::ptrdiff_t>(result.size());
    for (Index i = first; i != kNone; i = places_[static_cast<std::size_t>(i)].next) result.push_back(i);
    std::reverse(result.begin() + begin, result.end());  // insertion is at the front
  }
  return result;
}

void Surfels::begin(std::size_t elements, const std::vector<Index>& free_places) {
  free_ = free_places;
  std::fill(buckets_.begin(), buckets_.end(), kNone);
  surfels_.assign(elements + free_.size(), Surfel{});
  places_.assign(surfels_.size(), Place{});
}

void Surfels::put(Index index, const Surfel& surfel) {
  (*this)[index] = surfel;
  (*this)[index].alive = true;
  insert(index);
}

}  // namespace situation_awareness

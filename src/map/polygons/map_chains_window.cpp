// SPDX-License-Identifier: BSD-3-Clause
#include <algorithm>

#include "situation_awareness/map/polygons/map_chains.hpp"

// Which elements of a map are linked again.
namespace situation_awareness {

/// The tiles of what changed and, around them, of what it may be linked with or compared to.
void MapChains::mark_tiles(const Surfels& surfels) {
  for (const Surfels::Tile tile : marked_) marks_[static_cast<std::size_t>(tile)] = Mark::kNone;
  marks_.resize(surfels.tiles(), Mark::kNone);
  marked_.clear();
  const auto mark = [&](Surfels::Tile tile, Mark as) {
    Mark& own = marks_[static_cast<std::size_t>(tile)];
    if (own != Mark::kNone) return;
    own = as;
    marked_.push_back(tile);
  };
  if (is_all_touched_) {
    for (std::size_t k = 0; k < marks_.size(); ++k) mark(static_cast<Surfels::Tile>(k), Mark::kJudged);
    return;
  }
  const double reach_m = std::max(SeldomHit::kReach_m, ChainLinks::reach_m(spacing_m_));
  const auto mark_near = [&](const Eigen::Vector2d& p_world_m) {
    surfels.for_each_tile(p_world_m, reach_m, [&](Surfels::Tile tile) { mark(tile, Mark::kJudged); });
  };
  for (const Index i : touched_) {
    if (surfels[i].alive && surfels[i].confirmed && member(i).is_touched) mark_near(surfels[i].p_world_m);
  }
  for (const Eigen::Vector2d& p_world_m : removed_world_m_) mark_near(p_world_m);
  for (const Index i : names_.were_renamed()) {
    if (surfels[i].alive) mark_near(surfels[i].p_world_m);
  }
  std::size_t begin = 0;
  for (const Mark around : {Mark::kBeside, Mark::kContext}) {
    const std::size_t end = marked_.size();
    for (; begin < end; ++begin) {
      surfels.for_each_tile_around(marked_[begin], [&](Surfels::Tile tile) { mark(tile, around); });
    }
  }
}

void MapChains::enter_window(Index index) {
  Member& own = member(index);
  if (own.is_in_window) return;
  own.is_in_window = true;
  window_.push_back(index);
}

void MapChains::enter_window(Slot slot, bool is_touched) {
  Kept& own = kept(slot);
  own.is_touched |= is_touched;
  if (own.is_in_window) return;
  own.is_in_window = true;
  window_slots_.push_back(slot);
}

/// An id goes to the chain with most of its elements: all that have some of one are named together.
void MapChains::enter_window_of_name(std::uint64_t name) {
  const auto enter = [&](Slot slot) {
    if (slot == kNone || kept(slot).is_in_window) return;
    enter_window(slot, false);
    for (Index i = kept(slot).first; i != kNone; i = member(i).after) enter_window(i);
  };
  const Holder* holder = holder_of(name);
  if (holder != nullptr) enter(holder->slot);
  names_.mark(name, [&](Index i) { enter(member(i).slot); });
}

/// All elements that are linked again: those in the marked tiles, and the whole of the chains that are there.
void MapChains::find_window(const Surfels& surfels) {
  room_for(static_cast<std::size_t>(surfels.end()));
  mark_tiles(surfels);
  window_.clear();
  for (const Index i : touched_) {
    if (member(i).is_touched && member(i).slot != kNone) enter_window(member(i).slot, true);
  }
  for (const Surfels::Tile tile : marked_) {
    if (marks_[static_cast<std::size_t>(tile)] == Mark::kContext) continue;
    surfels.for_each_of(tile, [&](Index i) {
      if (!surfels[i].confirmed) return;
      if (member(i).slot == kNone) enter_window(i);
      if (member(i).slot != kNone) enter_window(member(i).slot, is_all_touched_);
    });
  }
  for (const Slot slot : window_slots_) {
    for (Index i = kept(slot).first; i != kNone; i = member(i).after) enter_window(i);
  }
  std::uint64_t name = 0;
  for (std::size_t k = 0; k < window_.size(); ++k) {
    if (surfels[window_[k]].chain == name) continue;
    name = surfels[window_[k]].chain;
    enter_window_of_name(name);
  }
  context_.clear();
  for (const Surfels::Tile tile : marked_) {
    if (marks_[static_cast<std::size_t>(tile)] != Mark::kContext) continue;
    surfels.for_each_of(tile, [&](Index i) {
      if (surfels[i].confirmed && !member(i).is_in_window) context_.push_back(i);
    });
  }
  std::sort(context_.begin(), context_.end());
  constexpr std::size_t kSparse = 8;
  if (window_.size() * kSparse < members_.size()) {
    std::sort(window_.begin(), window_.end());
    return;
  }
  window_.clear();
  for (std::size_t k = 0; k < members_.size(); ++k) {
    if (members_[k].is_in_window) window_.push_back(static_cast<Index>(k));
  }
}

}  // namespace situation_awareness

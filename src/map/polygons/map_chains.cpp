// SPDX-License-Identifier: BSD-3-Clause
#include "situation_awareness/map/polygons/map_chains.hpp"

#include <algorithm>
#include <cmath>

#include "situation_awareness/common/time.hpp"
#include "situation_awareness/common/usual_room.hpp"

namespace situation_awareness {
namespace {

/// An element that was hit by less than this part of the scans that hit one beside it, within so many m and after so
/// many s, is no surface: beams over an edge end there now and then.
constexpr double kRare = 0.2;
constexpr double kRareReach_m = 0.12;
constexpr double kRareAfter_s = 5.0;
/// The same of one that has none beside it, if it was hit for less than this part of its age, and of so many s.
constexpr double kLonely = 0.03;
constexpr double kLonely_s = 1.5;
/// A chain of so few elements, all of them so near to a larger one, is none of its own.
constexpr std::size_t kFewElements = 3;
constexpr double kOnChain_m = 0.045;
/// The links of an element along its line depend on others within so many times their reach: those that are each
/// other's best, two each of three rounds, one for what crosses them, and one for whether they are shown.
constexpr double kLineReaches = 8.0;
/// Vertices that a chain of a list gets room for, whichever chain has its place there.
constexpr std::size_t kUsualVertices = 32;
/// m. Least length of the tiles.
constexpr double kLeastTile_m = 1.0;

bool are_same(const Chain& a, const Chain& b) {
  const auto are_same_vertices = [](const ChainVertex& v, const ChainVertex& w) {
    return v.p_world_m == w.p_world_m && v.sigma_m == w.sigma_m;
  };
  return a.closed == b.closed && a.first_seen_ns == b.first_seen_ns && a.last_seen_ns == b.last_seen_ns &&
         a.p_exists == b.p_exists && a.vertices.size() == b.vertices.size() &&
         std::equal(a.vertices.begin(), a.vertices.end(), b.vertices.begin(), are_same_vertices);
}

/// Part of its age for which an element was hit.
double seen_share(double seen_s, double age_s) { return seen_s / std::max(age_s, kRareAfter_s); }

/// s. An element as old as `own_age_s` would have been hit for so long, if it was hit as one beside it.
double expected_by(double other_seen_s, double other_share, double own_age_s) {
  return std::min(other_seen_s, other_share * own_age_s);
}

/// s. A chain that no scan hit for so long is told at once when one does.
constexpr double kSeenAgain_s = 1.0;
/// Log-odds of existence below which a chain that beams pass is told at once, each time that they fell by so much.
constexpr double kDoubted = 3.0, kDoubtStep = 0.75;

/// This order makes a heap with the earliest first.
constexpr auto kIsLater = [](const auto& a, const auto& b) { return a.at_ns > b.at_ns; };

BoundaryElement boundary_of(const Surfel& surfel) {
  return {surfel.p_world_m, surfel.along_world(), surfel.variance_m2, surfel.low_m, surfel.high_m};
}

}  // namespace

MapChains::MapChains(double spacing_m, double max_gap_m, double tolerance_m)
    : spacing_m_(spacing_m), max_gap_m_(max_gap_m), tolerance_m_(tolerance_m) {
  for (std::vector<ChainLinks::Run>* runs : {&shown_, &hidden_}) runs->reserve(kUsualRoom);
  for (std::vector<std::uint64_t>* ids : {&ids_, &lost_names_, &changes_.changed, &changes_.gone}) {
    ids->reserve(kUsualRoom);
  }
  for (std::vector<Slot>* slots : {&free_slots_, &window_slots_, &slots_}) slots->reserve(kUsualRoom);
  removed_world_m_.reserve(kUsualRoom);
  rooms_.reserve(kUsualRoom);
  for (std::vector<Index>* list : {&ageing_, &were_ageing_}) list->reserve(kUsualRoom);
  due_.reserve(kUsualRoom);
}

/// What is in a tile is farther than any gap from what is in one that does not touch it, and than whatever the links of
/// an element along its line depend on.
double MapChains::tile_m(double spacing_m, double max_gap_m) {
  return std::max({kLeastTile_m, 1.5 * max_gap_m, kLineReaches * ChainLinks::reach_m(spacing_m)});
}

/// Makes the members at least so many.
void MapChains::room_for(std::size_t members) {
  if (members_.size() >= members) return;
  make_room(members_, members);
  members_.resize(members);
}

void MapChains::touch(Index index) {
  room_for(static_cast<std::size_t>(index) + 1);
  Member& own = member(index);
  if (own.is_touched) return;
  own.is_touched = true;
  touched_.push_back(index);
}

void MapChains::remove(const Surfels& surfels, Index index) {
  if (static_cast<std::size_t>(index) >= members_.size()) return;  // added since the latest update
  Member& own = member(index);
  if (surfels[index].confirmed) removed_world_m_.push_back(surfels[index].p_world_m);
  if (own.slot != kNone) {
    enter_window(own.slot, true);
    Kept& chain = kept(own.slot);
    --chain.elements;
    if (own.after != kNone) member(own.after).before = own.before;
    (own.before == kNone ? chain.first : member(own.before).after) = own.after;
  }
  if (own.line_right != kNone) member(own.line_right).line_left = kNone;
  if (own.line_left != kNone) member(own.line_left).line_right = kNone;
  count(index, 0);
  own = Member{};
}

void MapChains::touch_all() { is_all_touched_ = true; }

void MapChains::begin_anew(std::uint64_t next_id) {
  next_id_ = std::max(next_id_, next_id);
  joined_at_ns_ = std::numeric_limits<std::int64_t>::min();
  joints_ = Joints();
  if (!is_begun_anew_) {
    for (const Holder& holder : holders_) before_anew_.push_back(kept(holder.slot).chain);
  }
  is_begun_anew_ = is_all_touched_ = true;
  kept_.clear();
  for (std::vector<Slot>* slots : {&free_slots_, &window_slots_}) slots->clear();
  holders_.clear();
  names_.clear();
  lost_names_.clear();
  due_.clear();
  removed_world_m_.clear();
  for (std::vector<Index>* list : {&touched_, &renamed_, &ageing_, &were_ageing_}) list->clear();
  members_.clear();
}

/// To those of the update: what is not as it was before begin_anew().
void MapChains::add_changes_by_beginning_anew() {
  is_begun_anew_ = false;
  changes_.changed.clear();
  changes_.gone.clear();
  std::size_t before = 0;
  for (const Holder& holder : holders_) {
    for (; before < before_anew_.size() && before_anew_[before].id < holder.id; ++before) {
      changes_.gone.push_back(before_anew_[before].id);
    }
    const bool was_there = before < before_anew_.size() && before_anew_[before].id == holder.id;
    if (!was_there || !are_same(before_anew_[before], kept(holder.slot).chain)) {
      changes_.changed.push_back(holder.id);
    }
    before += was_there ? 1 : 0;
  }
  for (; before < before_anew_.size(); ++before) changes_.gone.push_back(before_anew_[before].id);
  before_anew_.clear();
}

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
  const double reach_m = std::max(kRareReach_m, ChainLinks::reach_m(spacing_m_));
  const auto mark_near = [&](const Eigen::Vector2d& p_world_m) {
    surfels.for_each_tile(p_world_m, reach_m, [&](Surfels::Tile tile) { mark(tile, Mark::kJudged); });
  };
  for (const Index i : touched_) {
    if (surfels[i].alive && surfels[i].confirmed && member(i).is_touched) mark_near(surfels[i].p_world_m);
  }
  for (const Eigen::Vector2d& p_world_m : removed_world_m_) mark_near(p_world_m);
  for (const Index i : was_renamed_) {
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
  const auto own = named(name);
  if (own == names_.end() || own->name != name || own->update == update_) return;
  own->update = update_;
  for (Index i = own->first; i != kNone; i = member(i).next_of_name) enter(member(i).slot);
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

/// Compares an element with those beside it. One that was hit seldom since it was first seen is not shown.
void MapChains::judge(LinkElement& own, std::size_t place) const {
  double expected_s = own.seen_s, seen_s = own.seen_s;
  double elements = 1.0;
  own.is_crossed = false;
  near_.for_each(static_cast<NearElements::Index>(place), [&](NearElements::Index j) {
    const LinkElement& other = link_elements_[static_cast<std::size_t>(j)];
    const double part = (other.p_world_m - own.p_world_m).squaredNorm() <= kRareReach_m * kRareReach_m ? 1.0 : 0.0;
    expected_s += part * expected_by(other.seen_s, other.seen_share, own.age_s);
    seen_s += part * other.seen_s;
    elements += part;
    own.is_crossed |= other.faces_another_way(own);
  });
  own.is_shown = own.age_s < kRareAfter_s || own.seen_s >= kRare * expected_s / elements;
  own.is_ageing = own.is_shown && own.seen_s < kRare * seen_s / elements;
}

/// The stamp from which on an element that is shown is not, if nothing beside it changes: judge() and is_lonely()
/// depend on its age.
std::int64_t MapChains::hidden_from_ns(const Surfels& surfels, Index index) {
  constexpr std::int64_t kStep_ns = 1'000'000;
  constexpr std::int64_t kLongest_ns = 1'000'000 * kNanosecondsPerSecond;
  const Surfel& own = surfels[index];
  const Slot slot = member(index).slot;
  std::int64_t result_ns = kNever;
  if (slot != kNone && kept(slot).elements == 1 && kept(slot).chain.id != 0 && own.seen_s < kLonely_s) {
    result_ns = own.first_seen_ns + nanoseconds(std::max(kRareAfter_s, own.seen_s / kLonely)) + kStep_ns;
  }
  beside_.clear();
  double seen_s = own.seen_s;
  surfels.for_each_near(own.p_world_m, kRareReach_m, [&](Index i, const Surfel& other) {
    const double distance_m2 = (other.p_world_m - own.p_world_m).squaredNorm();
    if (i == index || !other.confirmed || distance_m2 > kRareReach_m * kRareReach_m) return;
    beside_.push_back({other.seen_s, other.first_seen_ns});
    seen_s += other.seen_s;
  });
  const double elements = 1.0 + static_cast<double>(beside_.size());
  if (own.seen_s >= kRare * seen_s / elements) return result_ns;
  const auto is_rare = [&](std::int64_t stamp_ns) {
    const double age_s = seconds_between(own.first_seen_ns, stamp_ns);
    double expected_s = own.seen_s;
    for (const Beside& other : beside_) {
      const double share = seen_share(other.seen_s, seconds_between(other.first_seen_ns, stamp_ns));
      expected_s += expected_by(other.seen_s, share, age_s);
    }
    return own.seen_s < kRare * expected_s / elements;
  };
  std::int64_t low_ns = own.first_seen_ns + nanoseconds(kRareAfter_s);
  if (is_rare(low_ns)) return std::min(result_ns, low_ns);
  std::int64_t way_ns = kNanosecondsPerSecond;
  while (way_ns < kLongest_ns && !is_rare(low_ns + way_ns)) way_ns *= 2;
  if (way_ns >= kLongest_ns) return result_ns;
  std::int64_t high_ns = low_ns + way_ns;
  while (high_ns - low_ns > kStep_ns) {
    const std::int64_t middle_ns = low_ns + (high_ns - low_ns) / 2;
    (is_rare(middle_ns) ? high_ns : low_ns) = middle_ns;
  }
  return std::min(result_ns, high_ns);
}

/// An entry that is earlier than it has to be plans the next one.
void MapChains::plan(Index index, std::int64_t at_ns) {
  if (at_ns >= member(index).due_ns) return;
  member(index).due_ns = at_ns;
  due_.push_back({at_ns, index});
  std::push_heap(due_.begin(), due_.end(), kIsLater);
}

/// Plans those that the update before judged and this one does not: in between each scan judges them.
void MapChains::plan_unjudged(const Surfels& surfels) {
  for (const Index i : were_ageing_) {
    if (surfels[i].alive && surfels[i].confirmed && mark_of(surfels, i) != Mark::kJudged) {
      plan(i, hidden_from_ns(surfels, i));
    }
  }
  std::swap(ageing_, were_ageing_);
  ageing_.clear();
}

void MapChains::touch_due(const Surfels& surfels, std::int64_t stamp_ns) {
  while (!due_.empty() && due_.front().at_ns <= stamp_ns) {
    const Due due = due_.front();
    std::pop_heap(due_.begin(), due_.end(), kIsLater);
    due_.pop_back();
    if (member(due.index).due_ns != due.at_ns) continue;
    member(due.index).due_ns = kNever;
    const Surfel& surfel = surfels[due.index];
    if (!surfel.alive || !surfel.confirmed || !member(due.index).is_shown) continue;
    const std::int64_t at_ns = hidden_from_ns(surfels, due.index);
    if (at_ns <= stamp_ns) {
      touch(due.index);
    } else {
      plan(due.index, at_ns);
    }
  }
}

void MapChains::link(const Surfels& surfels, std::int64_t since_ns, std::int64_t stamp_ns,
                     const ChainLinks::View& view) {
  link_elements_.clear();
  all_links_.clear();
  to_link_.resize(window_.size() + context_.size());
  std::merge(window_.begin(), window_.end(), context_.begin(), context_.end(), to_link_.begin());
  for (const Index i : to_link_) {
    const Surfel& surfel = surfels[i];
    member(i).place = static_cast<NearElements::Index>(link_elements_.size());
    LinkElement& element = link_elements_.emplace_back();
    element.p_world_m = surfel.p_world_m;
    element.normal_world = surfel.normal_world;
    element.sigma_m = std::sqrt(surfel.variance_m2);
    element.low_m = surfel.low_m;
    element.high_m = surfel.high_m;
    element.seen_s = surfel.seen_s;
    element.age_s = seconds_between(surfel.first_seen_ns, stamp_ns);
    element.seen_share = seen_share(element.seen_s, element.age_s);
    element.chain = surfel.chain;
    element.index = i;
    element.is_hit = surfel.last_seen_ns > since_ns;
    all_links_.push_back(static_cast<NearElements::Index>(all_links_.size()));
  }
  near_.find(link_elements_, all_links_, std::max(kRareReach_m, ChainLinks::reach_m(spacing_m_)));
  for (std::size_t k = 0; k < link_elements_.size(); ++k) {
    LinkElement& element = link_elements_[k];
    Member& own = member(element.index);
    const Mark mark = mark_of(surfels, element.index);
    element.is_context = mark == Mark::kContext;
    if (element.is_context || mark == Mark::kNone) keep_line(element);
    if (mark == Mark::kJudged) {
      judge(element, k);
      own.is_shown = element.is_shown;
      own.is_crossed = element.is_crossed;
      if (element.is_ageing) ageing_.push_back(element.index);
    } else {  // nothing beside it changed, and not all of it is known here
      element.is_shown = own.is_shown;
      element.is_crossed = own.is_crossed;
    }
  }
  ChainLinks::View once = view;
  if (joined_at_ns_ == stamp_ns) once.step_s = 0.0;
  joined_at_ns_ = stamp_ns;
  if (once.step_s > 0.0) {  // time passes for the joints of what is linked now: the others stay as they are
    const auto is_here = [&](std::uint64_t name) {
      const auto at = named(name);
      return at != names_.end() && at->name == name && at->update == update_;
    };
    joints_.unsee_unless([&](std::uint64_t low, std::uint64_t high) { return is_here(low) && is_here(high); });
  }
  links_.link(link_elements_, near_, spacing_m_, max_gap_m_, once, joints_);
  const auto index_of = [&](NearElements::Index place) {
    return place == kNone ? kNone : to_link_[static_cast<std::size_t>(place)];
  };
  for (std::size_t k = 0; k < link_elements_.size(); ++k) {
    Member& own = member(to_link_[k]);
    if (!own.is_in_window) continue;
    own.line_right = index_of(links_.line_right()[k]);
    own.line_left = index_of(links_.line_left()[k]);
  }
}

/// What is farther from all that changed than any link along a line reaches is linked as before: not all of what is
/// beside it is known here.
void MapChains::keep_line(LinkElement& element) {
  const Member& own = member(element.index);
  const auto place_of = [&](Index index) {
    return index != kNone && member(index).is_in_window ? member(index).place : kNone;
  };
  element.is_kept = true;
  if (!own.is_in_window) return;
  element.is_linked = own.slot != kNone;
  element.right = place_of(own.line_right);
  element.left = place_of(own.line_left);
}

/// What is left of a thing that goes piece by piece is as large as the thing was: only what is hit is measured.
void MapChains::measure(Surfels& surfels, std::int64_t since_ns) const {
  for (const Index i : window_) surfels[i].elements_of_chain = 0;
  for (const ChainLinks::Run& run : links_.chains()) {
    for (std::size_t k = run.first; k < run.end; ++k) {
      Surfel& surfel = surfels[links_.ordered()[k]];
      surfel.elements_of_chain = static_cast<int>(run.end - run.first);
      if (surfel.last_seen_ns > since_ns) surfel.thing_m = std::max(surfel.thing_m, run.size_m);
    }
  }
}

/// Whether a chain of few elements lies on a larger one: what is left of a thing that touched a wall.
bool MapChains::is_beside_larger(const Surfels& surfels, const ChainLinks::Run& run) const {
  if (run.end - run.first > kFewElements) return false;
  for (std::size_t k = run.first; k < run.end; ++k) {
    const Surfel& surfel = surfels[links_.ordered()[k]];
    bool beside = false;
    surfels.for_each_near(surfel.p_world_m, kOnChain_m, [&](Index /*index*/, const Surfel& other) {
      beside |= other.elements_of_chain > static_cast<int>(kFewElements) &&
                (other.p_world_m - surfel.p_world_m).norm() < kOnChain_m;
    });
    if (!beside) return false;
  }
  return true;
}

/// Whether a chain is a single element that was there for long and hardly ever hit: beams over an edge far behind it.
bool MapChains::is_lonely(const Surfels& surfels, const ChainLinks::Run& run, std::int64_t stamp_ns) const {
  const Surfel& surfel = surfels[links_.ordered()[run.first]];
  const double age_s = seconds_between(surfel.first_seen_ns, stamp_ns);
  return run.end - run.first == 1 && age_s > kRareAfter_s && surfel.seen_s < std::min(kLonely * age_s, kLonely_s);
}

MapChains::Holder* MapChains::holder_of(std::uint64_t id) {
  const auto at = std::lower_bound(holders_.begin(), holders_.end(), id,
                                   [](const Holder& holder, std::uint64_t wanted) { return holder.id < wanted; });
  return at == holders_.end() || at->id != id ? nullptr : &*at;
}

/// An id goes to the chain with most of the elements that were first of it; what is left of a chain gets a new one. A
/// thing that touches another one now and then has its own id back when they part.
void MapChains::name_chains(Surfels& surfels) {
  const std::vector<Index>& ordered = links_.ordered();
  claims_.clear();
  for (std::size_t c = 0; c < shown_.size(); ++c) {
    const std::size_t first = claims_.size();
    for (std::size_t k = shown_[c].first; k < shown_[c].end; ++k) {
      const std::uint64_t id = surfels[ordered[k]].chain;
      if (id == 0) continue;
      if (claims_.size() == first || claims_.back().id != id) claims_.push_back({0, id, c});
      ++claims_.back().elements;
    }
  }
  std::sort(claims_.begin(), claims_.end(),
            [](const Claim& a, const Claim& b) { return a.id != b.id ? a.id < b.id : a.chain < b.chain; });
  std::size_t different = 0;
  for (const Claim& claim : claims_) {
    const bool is_same =
        different > 0 && claims_[different - 1].id == claim.id && claims_[different - 1].chain == claim.chain;
    if (is_same) {
      claims_[different - 1].elements += claim.elements;
    } else {
      claims_[different++] = claim;
    }
  }
  claims_.erase(claims_.begin() + static_cast<std::ptrdiff_t>(different), claims_.end());
  std::sort(claims_.begin(), claims_.end(), [](const Claim& a, const Claim& b) {
    if (a.elements != b.elements) return a.elements > b.elements;
    return a.id != b.id ? a.id < b.id : a.chain < b.chain;
  });
  assign_with_room(ids_, shown_.size(), 0);
  taken_.clear();
  for (const Claim& claim : claims_) {
    const auto place = std::lower_bound(taken_.begin(), taken_.end(), claim.id);
    if (ids_[claim.chain] != 0 || (place != taken_.end() && *place == claim.id)) continue;
    taken_.insert(place, claim.id);
    ids_[claim.chain] = claim.id;
  }
  for (std::size_t c = 0; c < shown_.size(); ++c) {
    const bool is_new = ids_[c] == 0;
    if (is_new) ids_[c] = next_id_++;
    name_elements(surfels, shown_[c], ids_[c], is_new);
    unite_names(surfels, shown_[c], ids_[c]);
  }
}

void MapChains::rename(Surfels& surfels, Index index, std::uint64_t name) {
  std::uint64_t& own = surfels[index].chain;
  if (own == name) return;
  if (own != 0) lost_names_.push_back(own);
  own = name;
  renamed_.push_back(index);
}

/// A new element gets the name of those on its side of the joints, so that what is joined can come apart again.
void MapChains::name_elements(Surfels& surfels, const ChainLinks::Run& run, std::uint64_t id, bool is_new) {
  const std::vector<Index>& ordered = links_.ordered();
  std::uint64_t name = is_new ? id : 0;
  for (std::size_t k = run.first; k < run.end; ++k) {
    Surfel& surfel = surfels[ordered[k]];
    if (is_new || surfel.chain == 0) rename(surfels, ordered[k], name);
    if (!is_new) name = links_.is_before_joint(k) ? 0 : surfel.chain;
  }
  if (is_new) return;
  for (std::size_t k = run.end; k-- > run.first;) {
    Surfel& surfel = surfels[ordered[k]];
    if (links_.is_before_joint(k)) name = 0;
    if (surfel.chain == 0) rename(surfels, ordered[k], name);
    name = surfel.chain;
  }
  for (std::size_t k = run.first; k < run.end; ++k) {
    if (surfels[ordered[k]].chain == 0) rename(surfels, ordered[k], id);
  }
}

/// Chains that met for long are one: what comes apart later is new. Where pieces of a line have grown together, they
/// meet.
void MapChains::unite_names(Surfels& surfels, const ChainLinks::Run& run, std::uint64_t id) {
  const std::vector<Index>& ordered = links_.ordered();
  std::size_t begin = run.first;  // of the elements with one name on one side of the joints
  std::size_t before = 0;         // elements of the name before, on the same side
  std::uint64_t name_before = 0;
  for (std::size_t k = run.first; k < run.end; ++k) {
    const std::uint64_t name = surfels[ordered[k]].chain;
    const bool ends = k + 1 == run.end || surfels[ordered[k + 1]].chain != name || links_.is_before_joint(k);
    if (!ends) continue;
    const std::size_t count = k + 1 - begin;
    if (std::min(before, count) >= kFewElements) joints_.see(name_before, name, true);
    const bool at_joint = links_.is_before_joint(k);
    before = at_joint ? 0 : count;
    name_before = name;
    begin = k + 1;
  }
  // From those named so, on both sides.
  const auto unite = [&](std::size_t from, std::size_t k, std::uint64_t& name_next) {
    const std::uint64_t name = surfels[ordered[k]].chain;
    const bool is_one = surfels[ordered[from]].chain == id && name != id &&
                        (joints_.is_firm(name, id) || joints_.is_firm(name, name_next));
    if (is_one) rename(surfels, ordered[k], id);
    name_next = name;
  };
  std::uint64_t original = surfels[ordered[run.first]].chain;
  for (std::size_t k = run.first + 1; k < run.end; ++k) unite(k - 1, k, original);
  original = surfels[ordered[run.end - 1]].chain;
  for (std::size_t k = run.end - 1; k-- > run.first;) unite(k + 1, k, original);
}

/// The first of names_ that is not below it.
std::vector<MapChains::Named>::iterator MapChains::named(std::uint64_t name) {
  return std::lower_bound(names_.begin(), names_.end(), name,
                          [](const Named& named, std::uint64_t wanted) { return named.name < wanted; });
}

bool MapChains::is_used(std::uint64_t name) {
  const auto at = named(name);
  return at != names_.end() && at->name == name && at->first != kNone;
}

/// Puts an element among those of a name; 0: of none.
void MapChains::count(Index index, std::uint64_t name) {
  Member& own = member(index);
  if (own.counted == name) return;
  if (own.counted != 0) {
    if (own.next_of_name != kNone) member(own.next_of_name).before_of_name = own.before_of_name;
    if (own.before_of_name != kNone) {
      member(own.before_of_name).next_of_name = own.next_of_name;
    } else {
      const auto before = named(own.counted);
      before->first = own.next_of_name;
      if (before->first == kNone) lost_names_.push_back(own.counted);
    }
  }
  own.counted = name;
  own.next_of_name = own.before_of_name = kNone;
  if (name == 0) return;
  auto at = named(name);
  if (at == names_.end() || at->name != name) {
    at = names_.insert(at, Named{});
    at->name = name;
  }
  if (at->first != kNone) member(at->first).before_of_name = index;
  own.next_of_name = at->first;
  at->first = index;
}

/// Joints of names that no element of a chain has any more are of no use.
void MapChains::count_names(const Surfels& surfels) {
  for (const Index i : window_) {
    count(i, member(i).slot != kNone ? surfels[i].chain : 0);
  }
  if (lost_names_.empty()) return;
  std::sort(lost_names_.begin(), lost_names_.end());
  lost_names_.erase(std::unique(lost_names_.begin(), lost_names_.end()), lost_names_.end());
  lost_names_.erase(
      std::remove_if(lost_names_.begin(), lost_names_.end(), [&](std::uint64_t name) { return is_used(name); }),
      lost_names_.end());
  if (lost_names_.empty()) return;
  joints_.forget(lost_names_);
  names_.erase(
      std::remove_if(named(lost_names_.front()), names_.end(), [](const Named& own) { return own.first == kNone; }),
      names_.end());
  lost_names_.clear();
}

/// The chain that these elements were, in this order, if nothing of it changed; else none.
MapChains::Slot MapChains::same_as_before(const ChainLinks::Run& run) const {
  const std::vector<Index>& ordered = links_.ordered();
  const auto member_of = [&](std::size_t k) -> const Member& { return members_[static_cast<std::size_t>(ordered[k])]; };
  const Slot slot = member_of(run.first).slot;
  if (slot == kNone) return kNone;
  const Kept& before = kept_[static_cast<std::size_t>(slot)];
  if (before.is_touched || before.first != ordered[run.first] || before.elements != run.end - run.first ||
      before.closed != run.closed || before.chain.id == 0) {
    return kNone;
  }
  for (std::size_t k = run.first; k + 1 < run.end; ++k) {
    if (member_of(k).after != ordered[k + 1]) return kNone;
  }
  return slot;
}

MapChains::Slot MapChains::new_slot() {
  if (free_slots_.empty()) {
    kept_.emplace_back();
    free_slots_.push_back(static_cast<Slot>(kept_.size() - 1));
  }
  const Slot slot = free_slots_.back();
  free_slots_.pop_back();
  kept(slot).is_alive = true;
  return slot;
}

/// A list of vertices: the one of least room that has enough, or the one of most. Rooms of all sizes find their use
/// again, and none has to grow once there are enough.
std::vector<ChainVertex> MapChains::take_room(std::size_t vertices) {
  const auto is_better = [&](const std::vector<ChainVertex>& a, const std::vector<ChainVertex>& b) {
    const bool fits = a.capacity() >= vertices;
    return fits != (b.capacity() >= vertices) ? fits : fits == (a.capacity() < b.capacity());
  };
  const auto best = std::min_element(rooms_.begin(), rooms_.end(), is_better);
  if (best == rooms_.end()) return {};
  std::vector<ChainVertex> result = std::move(*best);
  *best = std::move(rooms_.back());
  rooms_.pop_back();
  return result;
}

void MapChains::give_room(std::vector<ChainVertex> vertices) {
  if (vertices.capacity() > 0) rooms_.push_back(std::move(vertices));
}

void MapChains::keep(const ChainLinks::Run& run, Slot slot) {
  const std::vector<Index>& ordered = links_.ordered();
  Kept& chain = kept(slot);
  chain.first = ordered[run.first];
  chain.elements = run.end - run.first;
  chain.rank = run.rank;
  chain.closed = run.closed;
  chain.is_in_window = chain.is_touched = false;
  for (std::size_t k = run.first; k < run.end; ++k) {
    Member& own = member(ordered[k]);
    own.slot = slot;
    own.before = k > run.first ? ordered[k - 1] : kNone;
    own.after = k + 1 < run.end ? ordered[k + 1] : kNone;
  }
}

/// What a chain is, but for its id. The result is valid until the next call.
const Chain& MapChains::fitted(const Surfels& surfels, const Kept& kept) {
  Chain& result = fitted_;
  elements_.clear();
  double least_log_odds = Surfel::kMostLogOdds;
  result.first_seen_ns = std::numeric_limits<std::int64_t>::max();
  result.last_seen_ns = std::numeric_limits<std::int64_t>::min();
  for (Index i = kept.first; i != kNone; i = member(i).after) {
    const Surfel& surfel = surfels[i];
    elements_.push_back(boundary_of(surfel));
    result.first_seen_ns = std::min(result.first_seen_ns, surfel.first_seen_ns);
    result.last_seen_ns = std::max(result.last_seen_ns, surfel.last_seen_ns);
    least_log_odds = std::min(least_log_odds, surfel.log_odds);
  }
  result.closed = kept.closed;
  result.p_exists = 1.0 / (1.0 + std::exp(-least_log_odds));
  chain_fit_.fit(elements_, result.closed, tolerance_m_, result.vertices);
  return result;
}

/// Puts the new chains in the places of those that they were made of, and tells what is not as it was.
void MapChains::replace(const Surfels& surfels) {
  was_.clear();
  for (const Slot slot : window_slots_) {
    const std::uint64_t id = kept(slot).chain.id;
    if (id == 0) continue;
    was_.push_back({id, slot});
    holder_of(id)->slot = kNone;
  }
  const auto by_id = [](const Holder& a, const Holder& b) { return a.id < b.id; };
  std::sort(was_.begin(), was_.end(), by_id);
  // All are compared with what they were before any is kept: an element's place tells of its chain then.
  slots_.clear();
  for (const ChainLinks::Run& run : shown_) slots_.push_back(same_as_before(run));
  for (const Index i : window_) member(i).slot = kNone;
  for (std::size_t c = 0; c < shown_.size(); ++c) {
    const bool is_same = slots_[c] != kNone;
    const Slot slot = is_same ? slots_[c] : new_slot();
    keep(shown_[c], slot);
    Kept& own = kept(slot);
    const std::uint64_t id = ids_[c];
    const auto was = std::lower_bound(was_.begin(), was_.end(), Holder{id, kNone}, by_id);
    const bool is_known = was != was_.end() && was->id == id;
    const Chain& now = is_same ? own.chain : fitted(surfels, own);
    if (!is_known || (was->slot != slot && !are_same(kept(was->slot).chain, now))) changes_.changed.push_back(id);
    if (!is_same) {
      // What had the id is free already if it does not go on under another one.
      if (is_known && kept(was->slot).is_touched) give_room(std::move(kept(was->slot).chain.vertices));
      own.chain.vertices = take_room(now.vertices.size());
      copy_with_room(now, own.chain);
    }
    own.chain.id = id;
    if (is_known) {
      holder_of(id)->slot = slot;
    } else {
      holders_.insert(std::lower_bound(holders_.begin(), holders_.end(), Holder{id, slot}, by_id), {id, slot});
    }
  }
  for (const ChainLinks::Run& run : hidden_) {
    const Slot slot = new_slot();
    keep(run, slot);
    kept(slot).chain.id = 0;
  }
  std::sort(changes_.changed.begin(), changes_.changed.end());
  for (const Holder& was : was_) {
    if (holder_of(was.id)->slot == kNone) changes_.gone.push_back(was.id);
  }
  if (!changes_.gone.empty()) {
    const auto is_gone = [](const Holder& holder) { return holder.slot == kNone; };
    const auto first = holders_.begin() + (holder_of(changes_.gone.front()) - holders_.data());
    holders_.erase(std::remove_if(first, holders_.end(), is_gone), holders_.end());
  }
  for (const Slot slot : window_slots_) {
    if (!kept(slot).is_in_window) continue;  // it goes on
    kept(slot).is_alive = kept(slot).is_in_window = kept(slot).is_touched = false;
    give_room(std::move(kept(slot).chain.vertices));
    free_slots_.push_back(slot);
  }
}

/// Whether an element is on the surface of a chain, within a gap from its elements, so that it fills or prolongs it.
bool MapChains::is_beside_chain(const Surfels& surfels, Index index) const {
  const Surfel& own = surfels[index];
  bool any = false;
  surfels.for_each_near(own.p_world_m, max_gap_m_, [&](Index i, const Surfel& other) {
    if (static_cast<std::size_t>(i) >= members_.size() || member(i).slot == kNone) return;
    const Eigen::Vector2d d_m = other.p_world_m - own.p_world_m;
    any |= kept(member(i).slot).chain.id != 0 && d_m.squaredNorm() <= max_gap_m_ * max_gap_m_ &&
           other.normal_world.dot(own.normal_world) > LinkElement::kSameSurface &&
           std::abs(own.normal_world.dot(d_m)) < kOnChain_m;
  });
  return any;
}

bool MapChains::is_due(const Surfels& surfels, Index index, std::int64_t stamp_ns) const {
  const Surfel& own = surfels[index];
  if (!own.alive || !own.confirmed) return false;
  if (!member(index).is_known) return !is_beside_chain(surfels, index);
  if (member(index).slot == kNone || kept(member(index).slot).chain.id == 0) return false;
  const Chain& chain = kept(member(index).slot).chain;
  if (own.last_seen_ns == stamp_ns) return seconds_between(chain.last_seen_ns, stamp_ns) > kSeenAgain_s;
  return own.log_odds < kDoubted && own.log_odds + kDoubtStep < std::log(chain.p_exists / (1.0 - chain.p_exists));
}

bool MapChains::are_due(const Surfels& surfels, std::int64_t stamp_ns) const {
  if (is_all_touched_ || !removed_world_m_.empty() || !window_slots_.empty()) return true;
  return std::any_of(touched_.begin(), touched_.end(), [&](Index i) { return is_due(surfels, i, stamp_ns); });
}

/// What was hit after that was hit since the joints saw a scan. Where they saw none, or this one, it is what this one
/// hit.
std::int64_t MapChains::hit_since_ns(std::int64_t stamp_ns) const {
  constexpr std::int64_t kNone_ns = std::numeric_limits<std::int64_t>::min();
  if (stamp_ns == kNone_ns) return kNone_ns;
  return joined_at_ns_ == kNone_ns || joined_at_ns_ == stamp_ns ? stamp_ns - 1 : joined_at_ns_;
}

const ChainChanges& MapChains::no_changes() {
  changes_.changed.clear();
  changes_.gone.clear();
  return changes_;
}

const ChainChanges& MapChains::update(Surfels& surfels, std::int64_t stamp_ns, const ChainLinks::View& view) {
  no_changes();
  ++update_;
  was_renamed_.clear();
  if (stamp_ns != joined_at_ns_) std::swap(was_renamed_, renamed_);
  touch_due(surfels, stamp_ns);
  find_window(surfels);
  const std::int64_t since_ns = hit_since_ns(stamp_ns);
  link(surfels, since_ns, stamp_ns, view);
  measure(surfels, since_ns);
  shown_.clear();
  hidden_.clear();
  for (const ChainLinks::Run& run : links_.chains()) {
    const bool is_hidden = is_beside_larger(surfels, run) || is_lonely(surfels, run, stamp_ns);
    (is_hidden ? hidden_ : shown_).push_back(run);
    const Index first = links_.ordered()[run.first];
    if (!is_hidden && run.end - run.first == 1 && surfels[first].seen_s < kLonely_s) ageing_.push_back(first);
  }
  name_chains(surfels);
  std::sort(renamed_.begin(), renamed_.end());
  renamed_.erase(std::unique(renamed_.begin(), renamed_.end()), renamed_.end());
  replace(surfels);
  count_names(surfels);
  plan_unjudged(surfels);
  if (is_begun_anew_) add_changes_by_beginning_anew();
  for (const Index i : window_) {
    member(i).is_in_window = false;
    member(i).is_known = true;
  }
  for (const Index i : touched_) member(i).is_touched = false;
  touched_.clear();
  removed_world_m_.clear();
  window_slots_.clear();
  is_all_touched_ = false;
  return changes_;
}

const Chain* MapChains::find(std::uint64_t id) const {
  const auto at = std::lower_bound(holders_.begin(), holders_.end(), id,
                                   [](const Holder& holder, std::uint64_t wanted) { return holder.id < wanted; });
  return at == holders_.end() || at->id != id ? nullptr : &kept_[static_cast<std::size_t>(at->slot)].chain;
}

std::vector<Chain> MapChains::list(std::vector<Chain> memory) {
  std::vector<Chain> result = std::move(memory);
  listed_.clear();
  for (const Holder& holder : holders_) listed_.push_back(holder.slot);
  std::sort(listed_.begin(), listed_.end(), [&](Slot a, Slot b) { return kept(a).rank < kept(b).rank; });
  while (result.size() < listed_.size()) {
    if (spare_.empty()) {
      result.emplace_back().vertices.reserve(kUsualVertices);
    } else {
      result.push_back(std::move(spare_.back()));
      spare_.pop_back();
    }
  }
  for (; result.size() > listed_.size(); result.pop_back()) spare_.push_back(std::move(result.back()));
  for (std::size_t c = 0; c < listed_.size(); ++c) result[c] = kept(listed_[c]).chain;
  return result;
}

void MapChains::elements_of(const Surfels& surfels, std::size_t place, std::vector<BoundaryElement>& elements) const {
  elements.clear();
  Index i = kept_[static_cast<std::size_t>(listed_[place])].first;
  for (; i != kNone; i = members_[static_cast<std::size_t>(i)].after) elements.push_back(boundary_of(surfels[i]));
}

}  // namespace situation_awareness

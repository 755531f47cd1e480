// SPDX-License-Identifier: BSD-3-Clause
#include "situation_awareness/map/polygons/map_chains.hpp"

#include <algorithm>
#include <cmath>

#include "situation_awareness/common/time.hpp"
#include "situation_awareness/common/usual_room.hpp"

namespace situation_awareness {
namespace {

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
  for (std::vector<std::uint64_t>* ids : {&changes_.changed, &changes_.gone}) {
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
    names_.count(index, 0);
  }
  if (own.line_right != kNone) member(own.line_right).line_left = kNone;
  if (own.line_left != kNone) member(own.line_left).line_right = kNone;
  own = Member{};
}

void MapChains::touch_all() { is_all_touched_ = true; }

void MapChains::begin_anew(std::uint64_t next_id) {
  names_.begin_anew(next_id);
  joined_at_ns_ = std::numeric_limits<std::int64_t>::min();
  joints_ = Joints();
  if (!is_begun_anew_) {
    for (const Holder& holder : holders_) before_anew_.push_back(kept(holder.slot).chain);
  }
  is_begun_anew_ = is_all_touched_ = true;
  kept_.clear();
  for (std::vector<Slot>* slots : {&free_slots_, &window_slots_}) slots->clear();
  holders_.clear();
  due_.clear();
  removed_world_m_.clear();
  for (std::vector<Index>* list : {&touched_, &ageing_, &were_ageing_}) list->clear();
  members_.clear();
}

/// Adds to the changes of the update what is not as it was before begin_anew().
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

/// SeldomHit::hidden_from_ns of one that is shown.
std::int64_t MapChains::hidden_from_ns(const Surfels& surfels, Index index) {
  const Slot slot = member(index).slot;
  return seldom_hit_.hidden_from_ns(surfels, index,
                                    slot != kNone && kept(slot).elements == 1 && kept(slot).chain.id != 0);
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
    member(due.index).due_ns = SeldomHit::kNever;
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
    element.seen_share = SeldomHit::seen_share(element.seen_s, element.age_s);
    element.chain = surfel.chain;
    element.index = i;
    element.is_hit = surfel.last_seen_ns > since_ns;
    all_links_.push_back(static_cast<NearElements::Index>(all_links_.size()));
  }
  near_.find(link_elements_, all_links_, std::max(SeldomHit::kReach_m, ChainLinks::reach_m(spacing_m_)));
  for (std::size_t k = 0; k < link_elements_.size(); ++k) {
    LinkElement& element = link_elements_[k];
    Member& own = member(element.index);
    const Mark mark = mark_of(surfels, element.index);
    element.is_context = mark == Mark::kContext;
    if (element.is_context || mark == Mark::kNone) keep_line(element);
    if (mark == Mark::kJudged) {
      SeldomHit::judge(link_elements_, k, near_);
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
    joints_.unsee_unless(
        [&](std::uint64_t low, std::uint64_t high) { return names_.is_marked(low) && names_.is_marked(high); });
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

MapChains::Holder* MapChains::holder_of(std::uint64_t id) {
  const auto at = std::lower_bound(holders_.begin(), holders_.end(), id,
                                   [](const Holder& holder, std::uint64_t wanted) { return holder.id < wanted; });
  return at == holders_.end() || at->id != id ? nullptr : &*at;
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

/// The chains of the window, by their ids, which none has from now on.
void MapChains::take_ids() {
  was_.clear();
  for (const Slot slot : window_slots_) {
    const std::uint64_t id = kept(slot).chain.id;
    if (id == 0) continue;
    was_.push_back({id, slot});
    holder_of(id)->slot = kNone;
  }
  std::sort(was_.begin(), was_.end(), HasLessId());
}

/// Puts a chain that is shown in its place, the one that it had (`same`) if nothing of it changed, and tells if it is
/// not as what had its id.
void MapChains::put(const Surfels& surfels, const ChainLinks::Run& run, Slot same, std::uint64_t id) {
  const bool is_same = same != kNone;
  const Slot slot = is_same ? same : new_slot();
  keep(run, slot);
  Kept& own = kept(slot);
  const auto was = std::lower_bound(was_.begin(), was_.end(), Holder{id, kNone}, HasLessId());
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
    holders_.insert(std::lower_bound(holders_.begin(), holders_.end(), Holder{id, slot}, HasLessId()), {id, slot});
  }
}

/// Tells which ids of the window no chain has any more.
void MapChains::tell_gone() {
  for (const Holder& was : was_) {
    if (holder_of(was.id)->slot == kNone) changes_.gone.push_back(was.id);
  }
  if (changes_.gone.empty()) return;
  const auto is_gone = [](const Holder& holder) { return holder.slot == kNone; };
  const auto first = holders_.begin() + (holder_of(changes_.gone.front()) - holders_.data());
  holders_.erase(std::remove_if(first, holders_.end(), is_gone), holders_.end());
}

/// Puts the new chains, those shown with these ids, in the places of those that they were made of, and tells what is
/// not as it was.
void MapChains::replace(const Surfels& surfels, const std::vector<std::uint64_t>& ids) {
  take_ids();
  // All are compared with what they were before any is kept: an element's place tells of its chain then.
  slots_.clear();
  for (const ChainLinks::Run& run : shown_) slots_.push_back(same_as_before(run));
  for (const Index i : window_) member(i).slot = kNone;
  for (std::size_t c = 0; c < shown_.size(); ++c) put(surfels, shown_[c], slots_[c], ids[c]);
  for (const ChainLinks::Run& run : hidden_) {
    const Slot slot = new_slot();
    keep(run, slot);
    kept(slot).chain.id = 0;
  }
  std::sort(changes_.changed.begin(), changes_.changed.end());
  tell_gone();
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
  names_.begin_update(static_cast<std::size_t>(surfels.end()), stamp_ns != joined_at_ns_);
  touch_due(surfels, stamp_ns);
  find_window(surfels);
  const std::int64_t since_ns = hit_since_ns(stamp_ns);
  link(surfels, since_ns, stamp_ns, view);
  measure(surfels, since_ns);
  shown_.clear();
  hidden_.clear();
  for (const ChainLinks::Run& run : links_.chains()) {
    const Index first = links_.ordered()[run.first];
    const bool is_alone = run.end - run.first == 1;
    const bool is_hidden =
        is_beside_larger(surfels, run) || (is_alone && SeldomHit::is_lonely(surfels[first], stamp_ns));
    (is_hidden ? hidden_ : shown_).push_back(run);
    if (!is_hidden && is_alone && SeldomHit::may_get_lonely(surfels[first])) ageing_.push_back(first);
  }
  replace(surfels, names_.name(surfels, links_, shown_, joints_));
  for (const Index i : window_) names_.count(i, member(i).slot != kNone ? surfels[i].chain : 0);
  names_.forget_lost(joints_);
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

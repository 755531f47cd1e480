// SPDX-License-Identifier: BSD-3-Clause
#include "situation_awareness/map/semantic_map.hpp"

#include <algorithm>
#include <cmath>
#include <iterator>
#include <utility>
#include <vector>

#include "chain_cover.hpp"
#include "semantic_map_parts.hpp"
#include "situation_awareness/common/time.hpp"

namespace situation_awareness {
namespace {

/// m. Edge of a cell that chains are looked up by.
constexpr double kCell_m = 2.0;
/// m. A chain is looked for so far beside another one.
constexpr double kBesideMargin_m = 0.15;

}  // namespace

SemanticMap::SemanticMap(const HandOverParams& params, IdSource& ids, bool with_chains)
    : params_(params), ids_(&ids), with_chains_(with_chains) {
  params_.validate();
}

SemanticMap::TargetEntry* SemanticMap::find_target(Handle handle) { return at_handle(targets_, handle); }
const SemanticMap::TargetEntry* SemanticMap::find_target(Handle handle) const { return at_handle(targets_, handle); }
SemanticMap::BoundaryEntry* SemanticMap::find_boundary(Handle handle) { return at_handle(boundaries_, handle); }
const SemanticMap::BoundaryEntry* SemanticMap::find_boundary(Handle handle) const {
  return at_handle(boundaries_, handle);
}
SemanticMap::ObjectEntry* SemanticMap::find_object(Handle handle) { return at_handle(objects_, handle); }
const SemanticMap::ObjectEntry* SemanticMap::find_object(Handle handle) const { return at_handle(objects_, handle); }
SemanticMap::ChainEntry* SemanticMap::find_chain(Handle handle) { return at_handle(chains_, handle); }
const SemanticMap::ChainEntry* SemanticMap::find_chain(Handle handle) const { return at_handle(chains_, handle); }

const MapDelta& SemanticMap::update(const LayerUpdates& layers) {
  ++updates_;
  stamp_ns_ = layers.stamp_ns;
  if (layers.height_world_m) height_world_m_ = *layers.height_world_m;
  if (layers.sight) sights_.add(layers.stamp_ns, layers.sight->T_world_level, *layers.sight->free_space);
  touched_.clear();
  std::swap(touched_, touch_saved_);
  if (layers.sight && !saved_.empty()) look_through_saved();
  if (layers.polygons != nullptr) {
    take_chains(*layers.polygons);
    settle_overlaps();
    watch_parked();
  }
  if (layers.boundaries != nullptr) take_boundaries(*layers.boundaries);
  if (layers.objects != nullptr) take_objects(*layers.objects);
  for (ObjectEntry& object : objects_) hand_over(object);
  if (layers.objects != nullptr) leave_traces();
  if (layers.targets != nullptr) take_targets(*layers.targets);
  tell();
  return delta_;
}

void SemanticMap::begin_anew() {
  objects_.clear();
  chains_.clear();
  boundaries_.clear();
  targets_.clear();
  parked_.clear();
  traces_.clear();
  lost_.clear();
  lost_handles_.clear();
  chains_in_.clear();
  owners_.clear();
  new_.clear();
  unsettled_.clear();
  joined_.clear();
  sights_.clear();
  last_.clear();
  saved_.clear();
  touch_saved_.clear();
  saved_ids_.clear();
  saved_boundaries_.clear();
  on_map_ = 0;
  objects_stamp_ns_ = 0;
  is_new_ = true;
  ++maps_;
}

template <class Visit>
void SemanticMap::for_each_cell(const Eigen::AlignedBox2d& box_world_m, Visit&& visit) const {
  const auto cell = [](double m) { return static_cast<std::int64_t>(std::floor(m / kCell_m)); };
  for (std::int64_t y = cell(box_world_m.min().y()); y <= cell(box_world_m.max().y()); ++y) {
    for (std::int64_t x = cell(box_world_m.min().x()); x <= cell(box_world_m.max().x()); ++x) {
      visit((static_cast<std::uint64_t>(y) << 32) ^ (static_cast<std::uint64_t>(x) & 0xffffffffU));
    }
  }
}

/// The cells that its edges may come so near to; some of them more than once.
template <class Visit>
void SemanticMap::for_each_cell(const Chain& chain, double margin_m, Visit&& visit) const {
  for_each_edge(chain, [&](const Eigen::Vector2d& from, const Eigen::Vector2d& to) {
    const double steps = std::max(1.0, std::ceil((to - from).norm() / kCell_m));
    for (double step = 0.0; step < steps; step += 1.0) {
      Eigen::AlignedBox2d part(Eigen::Vector2d(from + step / steps * (to - from)));
      part.extend(from + (step + 1.0) / steps * (to - from));
      const Eigen::Vector2d margin = Eigen::Vector2d::Constant(margin_m);
      for_each_cell(Eigen::AlignedBox2d(part.min() - margin, part.max() + margin), visit);
    }
  });
}

void SemanticMap::place(const ChainEntry& chain) {
  for_each_cell(chain.latest, 0.0, [&](std::uint64_t cell) {
    std::vector<Handle>& there = chains_in_[cell];
    if (std::find(there.begin(), there.end(), chain.handle) == there.end()) there.push_back(chain.handle);
  });
}

void SemanticMap::remove(const ChainEntry& chain) {
  for_each_cell(chain.latest, 0.0, [&](std::uint64_t cell) {
    const auto there = chains_in_.find(cell);
    if (there == chains_in_.end()) return;
    there->second.erase(std::remove(there->second.begin(), there->second.end(), chain.handle), there->second.end());
    if (there->second.empty()) chains_in_.erase(there);
  });
}

/// near_: the chains that may be there, each once.
void SemanticMap::find_near(const Eigen::AlignedBox2d& box_world_m) {
  near_.clear();
  for_each_cell(box_world_m, [&](std::uint64_t cell) { add_near(cell); });
  sort_near();
}

void SemanticMap::find_near(const Chain& chain) {
  near_.clear();
  for_each_cell(chain, kBesideMargin_m, [&](std::uint64_t cell) { add_near(cell); });
  sort_near();
}

void SemanticMap::add_near(std::uint64_t cell) {
  const auto there = chains_in_.find(cell);
  if (there != chains_in_.end()) near_.insert(near_.end(), there->second.begin(), there->second.end());
}

void SemanticMap::sort_near() {
  std::sort(near_.begin(), near_.end());
  near_.erase(std::unique(near_.begin(), near_.end()), near_.end());
}

/// Gives a chain an id, in the place of the one that it had, which is part of that now unless something else has it.
/// Another chain that had it gets a new one, if it is shown.
void SemanticMap::own(ChainEntry& chain, FeatureId id) {
  Owner& owner = owners_[id];
  if (owner.chain == chain.handle) return;
  if (ChainEntry* const other = find_chain(owner.chain)) {
    other->id = 0;
    new_.push_back(other->handle);
  }
  if (chain.id != 0) {
    owners_[chain.id].chain = 0;
    merge(chain.id, id);
  }
  chain.id = id;
  owners_[id].chain = chain.handle;
  touched_.push_back(id);
}

/// Tells that the feature with the first id is part of that with the second one, if it is not shown any more.
void SemanticMap::merge(FeatureId id, FeatureId into) {
  if (id == 0 || into == 0 || id == into) return;
  owners_[id].into = into;
  touched_.push_back(id);
}

void SemanticMap::take_chains(const PolygonChanges& changes) {
  changed_world_m_.setEmpty();
  for (const Chain* chain : changes.changed) {
    ChainEntry* known = find_chain(chain->id);
    if (known != nullptr) {
      changed_world_m_.extend(known->box_world_m);
      unsettle_near(known->latest);
      remove(*known);
    } else {
      known = &add_at_handle(chains_, chain->id);
      new_.push_back(chain->id);
      if (const auto saved = saved_ids_.find(chain->id); saved != saved_ids_.end()) {
        known->id = saved->second;
        known->is_saved = true;
        owners_[known->id].chain = known->handle;
        saved_ids_.erase(saved);
      }
    }
    if (known->latest.p_exists != chain->p_exists) touch_boundary(known->of_boundary);
    known->latest = *chain;
    known->length_m = length_of(*chain);
    known->box_world_m.setEmpty();
    for (const ChainVertex& vertex : chain->vertices) known->box_world_m.extend(vertex.p_world_m);
    known->end_m = known->length_m;
    known->begin_m = 0.0;
    changed_world_m_.extend(known->box_world_m);
    place(*known);
    unsettle_near(known->latest);
    if (!saved_.empty() && !known->is_saved) take_saved_of(*known);
    touched_.push_back(known->id);
    look_at_traces(*known);
  }
  for (const Handle handle : changes.gone) drop_chain(handle);
}

void SemanticMap::drop_chain(Handle handle) {
  ChainEntry* const gone = find_chain(handle);
  if (gone == nullptr) return;
  remember_last(gone->id);
  changed_world_m_.extend(gone->box_world_m);
  remove(*gone);
  unsettle_near(gone->latest);
  if (ObjectEntry* const of = find_object(gone->of_object)) {
    of->chains.erase(std::remove(of->chains.begin(), of->chains.end(), handle), of->chains.end());
  }
  if (gone->id != 0) {
    Owner& owner = owners_[gone->id];
    owner.chain = 0;
    owner.reason = GoneReason::kSeenThrough;
    touched_.push_back(gone->id);
    // An object keeps its id.
    ChainEntry* const heir = owner.object == 0 ? heir_of(*gone) : nullptr;
    if (heir != nullptr) merge_chains(gone->id, *heir);
  }
  const Handle of_boundary = gone->of_boundary;
  chains_.erase(chains_.begin() + (gone - chains_.data()));
  if (BoundaryEntry* const boundary = find_boundary(of_boundary)) {
    --boundary->chains;
    if (boundary->main == handle) lead(*boundary);
    touch_boundary(of_boundary);
  }
}

/// What is beside it may show, or not show, its surface now.
void SemanticMap::unsettle_near(const Chain& line) {
  find_near(line);
  unsettled_.insert(unsettled_.end(), near_.begin(), near_.end());
}

/// The chain that gets the id of one that is gone: the longest other one of its boundary, or else that beside which
/// most of it was.
SemanticMap::ChainEntry* SemanticMap::heir_of(const ChainEntry& gone) {
  if (ChainEntry* const longest = longest_of(gone.of_boundary, gone.handle)) return longest;
  find_near(gone.latest);
  ChainEntry* heir = nullptr;
  double most = 0.5;
  for (const Handle handle : near_) {
    ChainEntry& other = *find_chain(handle);
    const double part = part_beside(gone.latest, other.latest);
    if (part <= most) continue;
    most = part;
    heir = &other;
  }
  return heir;
}

/// The longest chain of a boundary but that of a handle; null if there is none.
SemanticMap::ChainEntry* SemanticMap::longest_of(Handle boundary, Handle but) {
  ChainEntry* longest = nullptr;
  if (boundary == 0) return longest;
  for (ChainEntry& chain : chains_) {
    if (chain.of_boundary != boundary || chain.handle == but) continue;
    if (longest == nullptr || chain.length_m > longest->length_m) longest = &chain;
  }
  return longest;
}

/// Of two chains that are one the older id stays.
void SemanticMap::merge_chains(FeatureId id, ChainEntry& heir) {
  const FeatureId other = heir.id;
  if (other == 0 || id < other) {
    own(heir, id);
    if (other != 0) merge(other, id);
  } else {
    merge(id, other);
    touched_.push_back(other);
  }
}

/// The id under which a chain is on the map; 0 if it has none yet.
FeatureId SemanticMap::id_on_map(const ChainEntry& chain) const {
  if (const BoundaryEntry* const boundary = find_boundary(chain.of_boundary)) {
    const ChainEntry* const main = find_chain(boundary->main);
    return main != nullptr ? main->id : 0;
  }
  if (const ObjectEntry* const object = find_object(chain.of_object); object != nullptr && object->as == As::kItself) {
    return object->id;
  }
  if (chain.trace_of != 0) return chain.trace_of;
  const ChainEntry* const other = find_chain(chain.beside);
  return other != nullptr ? id_on_map(*other) : chain.id;
}

bool SemanticMap::is_shown(const ChainEntry& chain) const {
  if (const BoundaryEntry* const boundary = find_boundary(chain.of_boundary)) return boundary->main == chain.handle;
  if (chain.beside != 0 || chain.trace_of != 0 || !with_chains_) return false;
  return chain.of_object == 0 || find_object(chain.of_object)->as != As::kItself;
}

namespace {

void seen_between(std::int64_t first_ns, std::int64_t last_ns, Feature& feature) {
  feature.first_seen_ns = std::min(feature.first_seen_ns, first_ns);
  feature.last_seen_ns = std::max(feature.last_seen_ns, last_ns);
}

/// Where both know a class both say so independently of each other.
void add_class(ObjectClass object_class, double p_class, Feature& feature) {
  if (object_class == feature.object_class) {
    feature.p_class = 1.0 - (1.0 - feature.p_class) * (1.0 - p_class);
  } else if (p_class > feature.p_class) {
    feature.object_class = object_class;
    feature.p_class = p_class;
  }
}

void add_target(const GridTarget& target, Feature& feature) {
  feature.seen_by.camera = true;
  add_class(ObjectClass::kVehicle, target.probability, feature);
  feature.motion = Motion::kStanding;
  feature.shape = FootprintShape{target.p_world_m, target.covariance_m2, target.area_m2};
}

void add_object(const Object& object, Feature& feature) {
  add_class(object.object_class, object.p_class, feature);
  seen_between(object.first_seen_ns, object.last_seen_ns, feature);
  feature.p_moving = object.p_moving;
  feature.p_exists = object.p_exists;
  feature.motion = is_moving(object) ? Motion::kMoving : Motion::kStanding;
  const BodyState state{object.velocity_world_m_s, object.angular_velocity_rad_s, object.covariance};
  if (object.shape == Shape::kBox) {
    feature.shape = BoxShape{object.box_world, state};
  } else {
    feature.shape = EllipseShape{object.ellipse_world, state};
  }
}

/// Finds the feature with an id; null if none of these has it.
template <class Features>
auto feature_in(Features& features, FeatureId id) {
  const auto place =
      std::find_if(features.begin(), features.end(), [id](const Feature& feature) { return feature.id == id; });
  return place != features.end() ? &*place : nullptr;
}

}  // namespace

/// False if nothing of that id is on the map.
bool SemanticMap::feature_of(FeatureId id, const Owner& owner, Feature& feature) const {
  if (!shape_of(id, owner, feature)) return false;
  // What became one with something older was there then.
  if (owner.last_absent_ns < feature.first_seen_ns) feature.last_absent_ns = owner.last_absent_ns;
  return true;
}

/// The same but for its absence.
bool SemanticMap::shape_of(FeatureId id, const Owner& owner, Feature& feature) const {
  const ChainEntry* const chain = find_chain(owner.chain);
  const ObjectEntry* const object = find_object(owner.object);
  const TargetEntry* const target = find_target(owner.target);
  const bool is_chain = chain != nullptr && is_shown(*chain),
             is_object = object != nullptr && object->as == As::kItself;
  if (!is_chain && !is_object && target == nullptr) {
    const Feature* const saved = find_saved(id);
    if (saved != nullptr) feature = *saved;
    return saved != nullptr;
  }
  feature.id = id;
  feature.first_seen_ns = std::numeric_limits<std::int64_t>::max();
  feature.seen_by.scan = is_chain || is_object;
  if (target != nullptr) {
    add_target(target->latest, feature);
    seen_between(target->first_seen_ns, target->last_seen_ns, feature);
  }
  if (!is_chain && !is_object) return true;
  // What a larger thing has its id of is only a part of that.
  if (object != nullptr && object->as != As::kPartOfChain) add_object(object->latest, feature);
  if (!is_chain) return true;
  if (object == nullptr && owner.object_class != ObjectClass::kUnknown) {
    add_class(owner.object_class, owner.p_class, feature);
  }
  const Chain& latest = chain->latest;
  feature.p_exists = least_p_exists(*chain);
  seen_between(latest.first_seen_ns, latest.last_seen_ns, feature);
  const bool has_moved = object != nullptr ? object->has_moved : owner.has_moved;
  // What an object or a target was before its chain was drawn says nothing of how long that has stood.
  feature.motion = (has_stood_long(latest) || owner.is_fixed) && !has_moved ? Motion::kFixed : Motion::kStanding;
  if (const BoundaryEntry* const boundary = find_boundary(chain->of_boundary)) {
    seen_between(boundary->latest.first_seen_ns, boundary->latest.last_seen_ns, feature);
    feature.shape = ArcShape{boundary->latest.vertices, boundary->latest.closed};
  } else {
    feature.shape = PolylineShape{part_of(latest, chain->begin_m, chain->end_m), latest.closed};
  }
  return true;
}

/// Keeps what a feature is on the map as, which a layer is about to lose.
void SemanticMap::remember_last(FeatureId id) {
  const auto owner = owners_.find(id);
  if (owner == owners_.end() || !owner->second.is_on_map || feature_in(last_, id) != nullptr) return;
  Feature feature;
  if (feature_of(id, owner->second, feature)) last_.push_back(std::move(feature));
}

/// Tells of a feature that is gone when its place was free after it was seen, if that is known: it is on the map for
/// one more update.
bool SemanticMap::tell_absence(FeatureId id) {
  Feature* const last = feature_in(last_, id);
  Owner& owner = owners_[id];
  if (last == nullptr || owner.is_leaving) return false;
  last->first_absent_ns = sights_.first_free_ns(points_along(last->shape), last->last_seen_ns);
  if (!last->first_absent_ns && owner.reason == GoneReason::kSeenThrough) last->first_absent_ns = stamp_ns_;
  if (!last->first_absent_ns) return false;
  owner.is_leaving = owner.is_on_map = true;
  ++on_map_;
  delta_.changed.push_back(*last);
  return true;
}

/// Tells when what is gone was not there any more, in the place of that it is gone, where that was not told yet.
void SemanticMap::tell_absences() {
  const auto end = std::remove_if(delta_.gone.begin(), delta_.gone.end(), [this](const Gone& gone) {
    return gone.reason != GoneReason::kMerged && tell_absence(gone.id);
  });
  if (end != delta_.gone.end()) {
    delta_.gone.erase(end, delta_.gone.end());
    // Those that leave are behind the others, each part by ascending id.
    std::vector<Feature> all;
    all.reserve(delta_.changed.size());
    const auto is_before = [](const Feature& a, const Feature& b) { return a.id < b.id; };
    const auto leaving = std::is_sorted_until(delta_.changed.begin(), delta_.changed.end(), is_before);
    std::merge(delta_.changed.begin(), leaving, leaving, delta_.changed.end(), std::back_inserter(all), is_before);
    delta_.changed = std::move(all);
  }
  last_.erase(std::remove_if(last_.begin(), last_.end(),
                             [this](const Feature& last) {
                               const auto owner = owners_.find(last.id);
                               return owner == owners_.end() || !owner->second.is_leaving || !owner->second.is_on_map;
                             }),
              last_.end());
}

/// Returns the probability of existence of the least certain part of what a chain is on the map as: of a boundary that
/// of its least certain chain.
double SemanticMap::least_p_exists(const ChainEntry& chain) const {
  double p = chain.latest.p_exists;
  if (chain.of_boundary == 0) return p;
  for (const ChainEntry& other : chains_) {
    if (other.of_boundary == chain.of_boundary) p = std::min(p, other.latest.p_exists);
  }
  return p;
}

void SemanticMap::tell() {
  for (const Feature& last : last_) {
    if (owners_[last.id].is_leaving) touched_.push_back(last.id);
  }
  for (const Handle handle : new_) {
    ChainEntry* const chain = find_chain(handle);
    if (chain != nullptr && chain->id == 0 && is_shown(*chain)) own(*chain, ids_->next());
  }
  new_.clear();
  for (const Handle handle : joined_) {
    const ChainEntry* const chain = find_chain(handle);
    if (chain == nullptr || is_shown(*chain)) continue;
    const FeatureId into = id_on_map(*chain);
    if (into != 0 && into != chain->id) merge(chain->id, into);
  }
  joined_.clear();
  std::sort(touched_.begin(), touched_.end());
  touched_.erase(std::unique(touched_.begin(), touched_.end()), touched_.end());
  touched_.erase(touched_.begin(), std::upper_bound(touched_.begin(), touched_.end(), 0));  // of what has no id yet
  delta_.stamp_ns = stamp_ns_;
  delta_.objects_stamp_ns = objects_stamp_ns_;
  delta_.map = maps_;
  delta_.full = is_new_;
  delta_.base = is_new_ ? 0 : delta_.version;
  ++delta_.version;
  delta_.height_world_m = height_world_m_;
  is_new_ = false;
  delta_.changed.clear();
  delta_.gone.clear();
  for (const FeatureId id : touched_) {
    Owner& owner = owners_[id];
    Feature feature;
    if (feature_of(id, owner, feature)) {
      if (!owner.is_on_map && !owner.last_absent_ns) {
        owner.last_absent_ns = sights_.last_free_ns(points_along(feature.shape), feature.first_seen_ns);
        feature.last_absent_ns = owner.last_absent_ns;
      }
      delta_.changed.push_back(std::move(feature));
      on_map_ += owner.is_on_map ? 0 : 1;
      owner.is_on_map = true;
      owner.is_leaving = false;
      owner.into = 0;
    } else if (owner.is_on_map) {
      --on_map_;
      owner.is_on_map = false;
      delta_.gone.push_back({id, owner.reason, {}});
    }
  }
  for (Gone& gone : delta_.gone) {
    const FeatureId into = heir_on_map(owners_[gone.id].into);
    if (into == 0) {
      // No layer lost what became part of a feature that is off the map by now: nothing has seen its place free.
      const bool is_lost = feature_in(last_, gone.id) != nullptr;
      if (owners_[gone.id].into != 0 && !is_lost) gone.reason = GoneReason::kLeft;
      continue;
    }
    gone.reason = GoneReason::kMerged;
    gone.into = into;
  }
  tell_absences();
  for (const FeatureId id : touched_) {
    const Owner& owner = owners_[id];
    if (owner.object == 0 && owner.chain == 0 && owner.target == 0 && !owner.is_on_map) owners_.erase(id);
  }
}

/// The feature on the map that one was told to be part of, at last; 0 if there is none.
FeatureId SemanticMap::heir_on_map(FeatureId into) const {
  constexpr int kMostSteps = 10;
  for (int step = 0; step < kMostSteps && into != 0; ++step) {
    const auto owner = owners_.find(into);
    if (owner == owners_.end()) return 0;
    if (owner->second.is_on_map) return into;
    into = owner->second.into;
  }
  return 0;
}

Map SemanticMap::map(Map memory) const {
  std::vector<FeatureId> ids;
  for (const auto& [id, owner] : owners_) {
    if (owner.is_on_map) ids.push_back(id);
  }
  std::sort(ids.begin(), ids.end());
  Map result = std::move(memory);
  result.stamp_ns = stamp_ns_;
  result.objects_stamp_ns = objects_stamp_ns_;
  result.height_world_m = height_world_m_;
  result.features.clear();
  for (const FeatureId id : ids) {
    Feature& feature = result.features.emplace_back();
    if (!feature_of(id, owners_.at(id), feature)) feature = *feature_in(last_, id);
  }
  return result;
}

}  // namespace situation_awareness

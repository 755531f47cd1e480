// SPDX-License-Identifier: BSD-3-Clause
#include "situation_awareness/map/semantic_map.hpp"

#include <algorithm>
#include <array>

#include "chain_cover.hpp"
#include "semantic_map_parts.hpp"
#include "situation_awareness/common/time.hpp"

namespace situation_awareness {
namespace {

/// Part of a chain that is on an object whose boundary it becomes, and of one that it stays.
constexpr double kIsOfObject = 0.8, kStaysOfObject = 0.6;
/// A chain whose extent is at most so many times that of the object is of nothing larger: these parts are enough then.
constexpr double kAsLarge = 1.25, kIsOfAsLarge = 0.5, kStaysOfAsLarge = 0.3;
/// A chain that is at most so many times as long as when it became of an object stays of it down to this part: a box of
/// which one side is seen may be shorter in the next scan.
constexpr double kSameLength = 1.2, kStaysOfSameLength = 0.2;
/// An object is covered by chains if the length of these that it covers is that part of its lesser width, as any side
/// of it that is seen is as long; it stays covered down to the second one.
constexpr double kCovered = 0.5, kStaysCovered = 0.25;
/// s. What has been on no chain for longer did not drive off just now.
constexpr double kJustNow_s = 5.0;
/// s. What its layer does not list for so long is still on the map, unless beams pass where it was.
constexpr double kMissing_s = 1.0;
/// m. A chain may be so much farther beside what moves.
constexpr double kBesideMoving_m = 0.2;
/// Part of a chain that an object covered that is what the chain is of.
constexpr double kMostOfChain = 0.5;
/// s. What is seen for less, at a chain that has stood for long without it, may be somebody who has come.
constexpr double kJustCame_s = 2.0;
/// Objects that are remembered though they are part of larger things; and those that are, as their layer may find them
/// again.
constexpr std::size_t kMostParked = 1000, kMostLost = 1000;

/// Whether two estimates of an object say the same of a feature that is its chain.
bool are_same_as_chain(const Object& a, const Object& b) {
  return a.object_class == b.object_class && a.p_class == b.p_class && a.p_moving == b.p_moving &&
         a.first_seen_ns == b.first_seen_ns && a.last_seen_ns == b.last_seen_ns;
}

/// Whether they say the same of a feature that is the object.
bool are_same(const Object& a, const Object& b) {
  const auto numbers = [](const Object& object) {
    const Ellipse& ellipse = object.ellipse_world;
    const Box& box = object.box_world;
    return std::array<double, 14>{ellipse.center_m.x(),
                                  ellipse.center_m.y(),
                                  ellipse.psi_rad,
                                  ellipse.rx_m,
                                  ellipse.ry_m,
                                  box.center_m.x(),
                                  box.center_m.y(),
                                  box.psi_rad,
                                  box.half_length_m,
                                  box.half_width_m,
                                  object.p_exists,
                                  object.velocity_world_m_s.x(),
                                  object.velocity_world_m_s.y(),
                                  object.angular_velocity_rad_s};
  };
  return are_same_as_chain(a, b) && a.shape == b.shape && numbers(a) == numbers(b) && a.covariance == b.covariance;
}

/// Until when a map of objects says what is there: one that has hits on what it has not seen for a while is an older
/// one that is repeated with new stamps.
std::int64_t seen_until_ns(const Objects& objects) {
  std::int64_t until_ns = objects.stamp_ns;
  for (const Object& object : objects.objects) {
    if (object.beams > 0) until_ns = std::min(until_ns, object.last_seen_ns);
  }
  return until_ns;
}

}  // namespace

/// Forgets what is not on a chain any more for so long that it cannot have driven off just now. A chain that has become
/// what one of these is, as what was beside it is gone, is that again.
void SemanticMap::watch_parked() {
  for (Parked& parked : parked_) {
    const bool is_near = changed_world_m_.intersects(box_around(parked.object, 0.0));
    if (!is_near && parked.bare_since_ns == kNever) continue;
    find_covers(parked.object);
    double on_m = 0.0;
    for (const Cover& cover : covers_) {
      on_m += cover.on_object_m;
      ChainEntry& chain = *find_chain(cover.chain);
      if (chain.id <= parked.id || chain.of_object != 0 || cover.on_object_m < kIsOfObject * chain.length_m) continue;
      const Owner& owner = owners_[parked.id];
      if (owner.object != 0 || owner.chain != 0) continue;
      const FeatureId before = chain.id;
      own(chain, parked.id);
      merge(before, parked.id);
    }
    if (on_m >= kStaysCovered * lesser_width_of(parked.object)) {
      parked.bare_since_ns = kNever;
    } else if (parked.bare_since_ns == kNever) {
      parked.bare_since_ns = stamp_ns_;
    }
  }
  parked_.erase(std::remove_if(parked_.begin(), parked_.end(),
                               [this](const Parked& parked) {
                                 return parked.bare_since_ns != kNever &&
                                        seconds_between(parked.bare_since_ns, stamp_ns_) > kJustNow_s;
                               }),
                parked_.end());
}

void SemanticMap::forget_parked(FeatureId id) {
  parked_.erase(std::remove_if(parked_.begin(), parked_.end(), [id](const Parked& parked) { return parked.id == id; }),
                parked_.end());
}

/// The id of what had parked where an object is, if no other object has it; else 0.
FeatureId SemanticMap::id_of_parked(const Object& object) const {
  const auto was = std::find_if(parked_.begin(), parked_.end(), [&](const Parked& parked) {
    const auto owner = owners_.find(parked.id);
    if (owner != owners_.end() && owner->second.object != 0) return false;
    return covers(parked.object, object.ellipse_world.center_m, 0.0) &&
           (parked.object.object_class == object.object_class || object.object_class == ObjectClass::kUnknown ||
            parked.object.object_class == ObjectClass::kUnknown);
  });
  return was != parked_.end() ? was->id : 0;
}

/// The id of an object that its layer did not list before: that of what had parked there, or is there by a file, or
/// that of the chain that it was until now, or a new one.
FeatureId SemanticMap::id_of_new(const Object& object) {
  if (const FeatureId parked = id_of_parked(object)) return parked;
  if (const FeatureId saved = id_of_saved(object)) return saved;
  find_covers(object);
  for (const Cover& cover : covers_) {
    const ChainEntry& chain = *find_chain(cover.chain);
    const bool is_free = cover.is_of_object && chain.of_object == 0 && chain.id != 0;
    if (is_free && owners_[chain.id].object == 0) return chain.id;
  }
  return ids_->next();
}

/// The id of an object that its layer lists anew: its own where it was lost for a while.
FeatureId SemanticMap::id_of_lost(const Object& object) {
  const auto lost = lost_.find(object.id);
  if (lost == lost_.end()) return id_of_new(object);
  const FeatureId id = lost->second;
  lost_.erase(lost);
  // Its chain, or another object, may have the id now.
  const auto owner = owners_.find(id);
  const bool is_free = owner == owners_.end() || (owner->second.object == 0 && owner->second.chain == 0);
  return is_free ? id : id_of_new(object);
}

/// Whether beams pass where an object was since it was seen last.
bool SemanticMap::is_seen_through(const Object& object) const {
  if (is_moving(object)) return false;
  const std::optional<std::int64_t> free_ns = sights_.last_free_ns(outline_world(object), stamp_ns_ + 1);
  return free_ns && *free_ns > object.last_seen_ns;
}

void SemanticMap::take_objects(const Objects& objects) {
  objects_stamp_ns_ = seen_until_ns(objects);
  for (const Object& object : objects.objects) {
    ObjectEntry* known = find_object(object.id);
    if (known == nullptr) {
      const FeatureId id = id_of_lost(object);
      known = &add_at_handle(objects_, object.id);
      known->id = id;
      known->stood_since_ns = object.first_seen_ns;
      known->largest = object;
      known->is_id_of_chain = owners_[id].chain != 0;
      owners_[id].object = object.id;
    }
    const bool is_new = known->update == 0;
    const bool is_told = known->as == As::kItself     ? are_same(object, known->latest)
                         : known->as == As::kOwnChain ? are_same_as_chain(object, known->latest)
                                                      : true;
    if (is_new || !is_told) touched_.push_back(known->id);
    known->latest = object;
    known->update = updates_;
    known->missing_ns = kNever;
    known->predicted_ns = stamp_ns_;
    if (is_moving(object)) {
      known->has_moved = true;
      known->stood_since_ns = kNever;
    } else if (known->stood_since_ns == kNever) {
      known->stood_since_ns = known->came_ns = stamp_ns_;
    }
    const bool is_larger =
        is_moving(object) ? known->as == As::kItself : extent_of(object) >= extent_of(known->largest);
    if (is_larger) known->largest = object;
  }
  miss_objects();
}

/// What moves and is not seen goes on as it did.
void SemanticMap::go_on(ObjectEntry& object) {
  const double dt_s = seconds_between(object.predicted_ns, stamp_ns_);
  object.predicted_ns = stamp_ns_;
  Object& latest = object.latest;
  latest.ellipse_world.center_m += dt_s * latest.velocity_world_m_s;
  latest.box_world.center_m += dt_s * latest.velocity_world_m_s;
  Matrix8d F = Matrix8d::Identity();
  F.block<2, 2>(object_error::kPosition, object_error::kVelocity) = dt_s * Eigen::Matrix2d::Identity();
  latest.covariance = (F * latest.covariance * F.transpose()).eval();
  touched_.push_back(object.id);
}

/// What its layer does not list any more is gone, but for what may be listed again just now.
void SemanticMap::miss_objects() {
  for (ObjectEntry& object : objects_) {
    if (object.update == updates_) continue;
    if (object.missing_ns == kNever) object.missing_ns = stamp_ns_;
    const bool stays = object.as == As::kItself && object.chains.empty() && !is_seen_through(object.latest) &&
                       seconds_between(object.missing_ns, stamp_ns_) < kMissing_s;
    if (stays) {
      if (is_moving(object.latest)) go_on(object);
      continue;
    }
    release(object);
    object.handle = 0;
  }
  objects_.erase(
      std::remove_if(objects_.begin(), objects_.end(), [](const ObjectEntry& object) { return object.handle == 0; }),
      objects_.end());
}

/// An object that its layer does not follow any more is its chain, if there is one.
void SemanticMap::release(ObjectEntry& object) {
  remember_last(object.id);
  Owner& owner = owners_[object.id];
  owner.object = 0;
  owner.reason = is_seen_through(object.latest) ? GoneReason::kSeenThrough : GoneReason::kLeft;
  if (lost_handles_.size() == kMostLost) {
    lost_.erase(lost_handles_.front());
    lost_handles_.pop_front();
  }
  lost_handles_.push_back(object.handle);
  lost_[object.handle] = object.id;
  touched_.push_back(object.id);
  if (object.as != As::kItself) {
    forget_parked(object.id);
    if (parked_.size() == kMostParked) parked_.erase(parked_.begin());
    parked_.push_back({object.id, object.largest, object.came_ns, kNever});
  }
  for (const Handle handle : object.chains) {
    ChainEntry& chain = *find_chain(handle);
    chain.of_object = 0;
    if (owners_[object.id].chain == 0) own(chain, object.id);
    if (chain.id == 0) own(chain, ids_->next());
    touched_.push_back(chain.id);
  }
  if (owners_[object.id].chain != 0) return;
  // What it was thought to have driven off from is it after all.
  find_covers(object.latest);
  for (const Cover& cover : covers_) {
    ChainEntry& chain = *find_chain(cover.chain);
    if (chain.left_with != object.id || chain.of_object != 0) continue;
    const FeatureId before = chain.id;
    own(chain, object.id);
    merge(before, object.id);
    return;
  }
}

void SemanticMap::find_covers(const Object& object) {
  // What moves is drawn beside its estimate.
  const double margin_m = margin_of(object, params_.margin_m + (is_moving(object) ? kBesideMoving_m : 0.0));
  const Eigen::AlignedBox2d box = box_around(object, margin_m);
  find_near(box);
  covers_.clear();
  for (const Handle handle : near_) {
    const ChainEntry& chain = *find_chain(handle);
    if (!chain.box_world_m.intersects(box) || (!with_chains_ && chain.of_boundary == 0)) continue;
    if (chain.trace_of != 0) continue;
    const double on_m = length_on(object, chain.latest, margin_m);
    if (on_m <= 0.0) continue;
    const bool is_as_large = chain.box_world_m.diagonal().norm() <= kAsLarge * extent_of(object) + margin_m;
    double least = is_as_large ? kIsOfAsLarge : kIsOfObject;
    if (chain.of_object == object.id) {
      const bool is_same = chain.length_m <= kSameLength * chain.length_of_object_m;
      least = is_same ? kStaysOfSameLength : is_as_large ? kStaysOfAsLarge : kStaysOfObject;
    }
    // What other chains are of, too, is more than the object.
    const BoundaryEntry* const boundary = find_boundary(chain.of_boundary);
    const bool is_one = boundary == nullptr || boundary->chains == 1;
    covers_.push_back({handle, on_m, is_one && on_m >= least * chain.length_m});
  }
}

/// What an object is on the map as, after find_covers(). `chain` is set to the chain that has most of it, unless it is
/// itself.
SemanticMap::As SemanticMap::as_what(const ObjectEntry& object, Handle& chain) const {
  if (object.stood_since_ns == kNever) return As::kItself;
  double own_m = 0.0, part_m = 0.0, most_own_m = 0.0, most_part_m = 0.0;
  Handle own = 0, part = 0;
  for (const Cover& cover : covers_) {
    const bool is_own = cover.is_of_object && !was_there_before(*find_chain(cover.chain), object);
    double& sum_m = is_own ? own_m : part_m;
    double& most_m = is_own ? most_own_m : most_part_m;
    sum_m += cover.on_object_m;
    if (cover.on_object_m <= most_m) continue;
    most_m = cover.on_object_m;
    (is_own ? own : part) = cover.chain;
  }
  const double width_m = lesser_width_of(object.latest);
  const auto is_covered = [&](double by_m, As as) {
    return by_m > 0.0 && by_m >= (object.as == as ? kStaysCovered : kCovered) * width_m;
  };
  std::int64_t stood_since_ns = object.stood_since_ns;
  if (own != 0 && !object.has_moved) {
    stood_since_ns = std::min(stood_since_ns, find_chain(own)->latest.first_seen_ns);
  }
  const bool is_parked = seconds_between(stood_since_ns, stamp_ns_) >= params_.parked_after_s;
  if (part_m > own_m && (is_parked || !object.has_moved) && is_covered(part_m, As::kPartOfChain) &&
      may_be_part_of(object, *find_chain(part))) {
    chain = part;
    return As::kPartOfChain;
  }
  const bool is_boundary = own != 0 && find_chain(own)->of_boundary != 0;
  if ((is_parked || is_boundary) && is_covered(own_m, As::kOwnChain)) {
    chain = own;
    return As::kOwnChain;
  }
  return As::kItself;
}

/// Whether who drives by the map may take an object for a part of what a chain is of: never a person, nor what has just
/// come to a chain that has stood for long.
bool SemanticMap::may_be_part_of(const ObjectEntry& object, const ChainEntry& chain) const {
  if (object.latest.object_class == ObjectClass::kPerson) return false;
  const bool has_just_come = !object.has_moved && seconds_between(object.latest.first_seen_ns, stamp_ns_) < kJustCame_s;
  return object.as == As::kPartOfChain || !has_just_come || !has_stood_long(chain.latest);
}

/// Whether a chain was there before an object came: then it is of something else.
bool SemanticMap::was_there_before(const ChainEntry& chain, const ObjectEntry& object) const {
  if (!object.has_moved) return false;
  const std::int64_t came_ns = object.stood_since_ns != kNever ? object.stood_since_ns : stamp_ns_;
  return seconds_between(chain.latest.first_seen_ns, came_ns) > kJustNow_s;
}

/// Gives an object another id, of a feature that it is one with.
void SemanticMap::give_id(ObjectEntry& object, FeatureId id) {
  const FeatureId before = object.id;
  owners_[before].object = 0;
  owners_[id].object = object.handle;
  if (TargetEntry* const target = find_target(owners_[before].target); target != nullptr && owners_[id].target == 0) {
    owners_[before].target = 0;
    owners_[id].target = target->handle;
    target->id = id;
  }
  object.id = id;
  touched_.push_back(before);
  touched_.push_back(id);
}

/// The chains that are the boundary of an object, from now on or no longer, after find_covers().
void SemanticMap::find_chains_of(ObjectEntry& object) {
  for (const Handle handle : object.chains) {
    const auto cover = std::find_if(covers_.begin(), covers_.end(), [&](const Cover& c) { return c.chain == handle; });
    if (cover != covers_.end() && cover->is_of_object) continue;
    ChainEntry& chain = *find_chain(handle);
    chain.of_object = 0;
    if (chain.id == 0) own(chain, ids_->next());
    touched_.push_back(chain.id);
  }
  object.chains.clear();
  for (Cover& cover : covers_) {
    ChainEntry& chain = *find_chain(cover.chain);
    if (chain.of_object != 0 && chain.of_object != object.handle) {
      cover.is_of_object = false;
      // Else the other object is the feature, and the chain is none.
      if (find_object(chain.of_object)->as == As::kItself) cover.on_object_m = 0.0;
      continue;
    }
    if (!cover.is_of_object) continue;
    object.chains.push_back(cover.chain);
    const bool is_whole = cover.on_object_m >= kIsOfObject * chain.length_m;
    if (is_whole || chain.of_object != object.handle) chain.length_of_object_m = chain.length_m;
    if (chain.of_object == object.handle) continue;
    chain.of_object = object.handle;
    if (chain.id == 0 || chain.id == object.id) continue;
    if (!object.has_moved && chain.id < object.id && owners_[chain.id].object == 0) {
      merge(object.id, chain.id);
      give_id(object, chain.id);
      object.is_id_of_chain = true;
    } else {
      merge(chain.id, object.id);
    }
  }
}

/// Whether what leaves the chain that has its id is what that chain was of.
bool SemanticMap::takes_id_along(const ObjectEntry& object) const {
  if (!object.is_id_of_chain) return true;
  const bool had_parked =
      std::any_of(parked_.begin(), parked_.end(), [&](const Parked& parked) { return parked.id == object.id; });
  return object.has_moved && (had_parked || object.covered >= kMostOfChain);
}

/// It is the feature, and its chains are none.
void SemanticMap::make_itself(ObjectEntry& object, Handle was_part_of) {
  // What drives off from a chain that was of nothing else is that.
  const ChainEntry* const was = find_chain(was_part_of);
  if (was != nullptr && is_moving(object.latest) && object.covered >= kMostOfChain && was->id != 0 &&
      was->id < object.id && owners_[was->id].object == 0) {
    merge(object.id, was->id);
    give_id(object, was->id);
    object.is_id_of_chain = true;
  }
  for (const Handle handle : object.chains) {
    const FeatureId of_chain = find_chain(handle)->id;
    if (of_chain != 0 && of_chain != object.id) merge(of_chain, object.id);
  }
  if (ChainEntry* const other = find_chain(owners_[object.id].chain); other != nullptr && is_shown(*other)) {
    if (takes_id_along(object)) {
      const FeatureId id = object.id;
      own(*other, ids_->next());
      other->left_with = id;
    } else {
      give_id(object, ids_->next());
    }
    object.is_id_of_chain = false;
  }
  if (is_moving(object.latest)) object.covered = 0.0;
}

/// It is on the map as a part of a chain: under the older id, unless the chain is of something that was there before.
void SemanticMap::make_part_of(ObjectEntry& object, ChainEntry& chain) {
  if (!object.has_moved && chain.length_m > 0.0) {
    const double on_m = length_on(object.latest, chain.latest, margin_of(object.latest, params_.margin_m));
    object.covered = std::max(object.covered, on_m / chain.length_m);
  }
  if (id_on_map(chain) == 0) own(chain, ids_->next());
  const FeatureId id = id_on_map(chain);
  if (id == object.id) return;
  const bool is_older = object.id < id && !was_there_before(chain, object);
  ChainEntry* const shown = find_chain(owners_[id].chain);
  const ChainEntry* const own_chain = find_chain(owners_[object.id].chain);
  const bool is_free = shown != nullptr && (own_chain == nullptr || !is_shown(*own_chain));
  if (is_free && (is_older || shown->left_with == object.id)) {
    own(*shown, object.id);
    merge(id, object.id);
  } else {
    merge(object.id, id);
  }
}

void SemanticMap::hand_over(ObjectEntry& object) {
  find_covers(object.latest);
  find_chains_of(object);
  Handle chain = 0;
  As as = as_what(object, chain);
  if (as == As::kItself && !object.has_moved && object.chains.empty()) {
    const auto around = std::find_if(near_.begin(), near_.end(), [&](Handle handle) {
      const ChainEntry& candidate = *find_chain(handle);
      return is_shown(candidate) && candidate.of_boundary == 0 && is_inside(object.latest, candidate.latest) &&
             may_be_part_of(object, candidate);
    });
    if (around != near_.end()) {
      as = As::kPartOfChain;
      chain = *around;
    }
  }
  if (as != object.as || chain != object.chain) {
    touched_.push_back(object.id);
    for (const Handle handle : object.chains) {
      if (find_chain(handle)->id != 0) touched_.push_back(find_chain(handle)->id);
    }
  }
  const As was = object.as;
  if (!is_moving(object.latest)) forget_trace(object);
  const Handle was_part_of = object.as == As::kPartOfChain ? object.chain : 0;
  object.as = as;
  object.chain = chain;
  if (as == As::kItself) {
    make_itself(object, was_part_of);
    if (was != As::kItself && is_moving(object.latest)) leave_parked(object);
    if (is_moving(object.latest)) {
      forget_parked(object.id);
      object.largest = object.latest;
    }
    return;
  }
  if (as == As::kOwnChain) {
    if (!object.has_moved) object.covered = 1.0;
    own(*find_chain(chain), object.id);
  }
  new_.insert(new_.end(), object.chains.begin(), object.chains.end());
  if (as == As::kPartOfChain) make_part_of(object, *find_chain(chain));
}

}  // namespace situation_awareness

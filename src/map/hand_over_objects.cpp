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

}  // namespace

/// Forgets what is not on a chain any more for so long that it cannot have driven off just now. A chain that was one of
/// these and is of more now is another thing.
void SemanticMap::watch_parked() {
  for (Parked& parked : parked_) {
    const bool is_near = changed_world_m_.intersects(box_around(parked.object, 0.0));
    if (!is_near && parked.bare_since_ns == kNever) continue;
    find_covers(parked.object);
    double on_m = 0.0;
    for (const Cover& cover : covers_) {
      on_m += cover.on_object_m;
      ChainEntry& chain = *find_chain(cover.chain);
      if (chain.id != parked.id || cover.on_object_m >= kStaysOfObject * chain.length_m) continue;
      own(chain, ids_->next());
      merge(parked.id, chain.id);
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

/// The id of an object that its layer did not list before: that of what had parked there, or that of the chain that it
/// was until now, or a new one.
FeatureId SemanticMap::id_of_new(const Object& object) {
  const auto was = std::find_if(parked_.begin(), parked_.end(), [&](const Parked& parked) {
    // While it stands its own chain has its id.
    const auto owner = owners_.find(parked.id);
    if (!is_moving(object) && owner != owners_.end() && owner->second.chain != 0) return false;
    return covers(parked.object, object.ellipse_world.center_m, 0.0) &&
           (parked.object.object_class == object.object_class || object.object_class == ObjectClass::kUnknown ||
            parked.object.object_class == ObjectClass::kUnknown);
  });
  if (was != parked_.end()) {
    const FeatureId id = was->id;
    if (ChainEntry* stays = find_chain(owners_[id].chain)) own(*stays, ids_->next());
    return id;
  }
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
  const auto lost =
      std::find_if(lost_.begin(), lost_.end(), [&](const Lost& each) { return each.handle == object.id; });
  if (lost == lost_.end()) return id_of_new(object);
  const FeatureId id = lost->id;
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
  for (const Object& object : objects.objects) {
    ObjectEntry* known = find_object(object.id);
    if (known == nullptr) {
      const FeatureId id = id_of_lost(object);
      known = &add_at_handle(objects_, object.id);
      known->id = id;
      forget_parked(id);
      known->stood_since_ns = object.first_seen_ns;
      owners_[id].object = object.id;
    }
    const bool is_new = known->update == 0;
    const bool is_told = known->as == As::kItself     ? are_same(object, known->latest)
                         : known->as == As::kOwnChain ? are_same_as_chain(object, known->latest)
                                                      : true;
    if (is_new || !is_told) touched_.push_back(known->id);
    known->latest = object;
    known->update = updates_;
    if (is_moving(object)) {
      known->has_moved = true;
      known->stood_since_ns = kNever;
    } else if (known->stood_since_ns == kNever) {
      known->stood_since_ns = stamp_ns_;
    }
  }
  for (ObjectEntry& object : objects_) {
    if (object.update != updates_) release(object);
  }
  objects_.erase(std::remove_if(objects_.begin(), objects_.end(),
                                [this](const ObjectEntry& object) { return object.update != updates_; }),
                 objects_.end());
}

/// An object that its layer does not follow any more is its chain, if there is one.
void SemanticMap::release(ObjectEntry& object) {
  Owner& owner = owners_[object.id];
  owner.object = 0;
  owner.reason = is_seen_through(object.latest) ? GoneReason::kSeenThrough : GoneReason::kLeft;
  if (lost_.size() == kMostLost) lost_.erase(lost_.begin());
  lost_.push_back({object.handle, object.id});
  touched_.push_back(object.id);
  if (object.as != As::kItself) {
    if (parked_.size() == kMostParked) parked_.erase(parked_.begin());
    parked_.push_back({object.id, object.latest, kNever});
  }
  for (const Handle handle : object.chains) {
    ChainEntry& chain = *find_chain(handle);
    chain.of_object = 0;
    if (owners_[object.id].chain == 0) own(chain, object.id);
    if (chain.id == 0) own(chain, ids_->next());
    touched_.push_back(chain.id);
  }
}

void SemanticMap::find_covers(const Object& object) {
  const double margin_m = margin_of(object, params_.margin_m);
  const Eigen::AlignedBox2d box = box_around(object, margin_m);
  find_near(box);
  covers_.clear();
  for (const Handle handle : near_) {
    const ChainEntry& chain = *find_chain(handle);
    if (!chain.box_world_m.intersects(box) || (!with_chains_ && chain.of_boundary == 0)) continue;
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
    double& sum_m = cover.is_of_object ? own_m : part_m;
    double& most_m = cover.is_of_object ? most_own_m : most_part_m;
    sum_m += cover.on_object_m;
    if (cover.on_object_m <= most_m) continue;
    most_m = cover.on_object_m;
    (cover.is_of_object ? own : part) = cover.chain;
  }
  const double width_m = lesser_width_of(object.latest);
  const auto is_covered = [&](double by_m, As as) {
    return by_m > 0.0 && by_m >= (object.as == as ? kStaysCovered : kCovered) * width_m;
  };
  const bool is_parked = seconds_between(object.stood_since_ns, stamp_ns_) >= params_.parked_after_s;
  if (part_m > own_m && (is_parked || !object.has_moved) && is_covered(part_m, As::kPartOfChain)) {
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

void SemanticMap::hand_over(ObjectEntry& object) {
  find_covers(object.latest);
  // Chains that are its boundary, from now on or no longer.
  for (const Handle handle : object.chains) {
    const auto cover = std::find_if(covers_.begin(), covers_.end(), [&](const Cover& c) { return c.chain == handle; });
    if (cover != covers_.end() && cover->is_of_object) continue;
    ChainEntry& chain = *find_chain(handle);
    chain.of_object = 0;
    if (chain.id == 0 || chain.id == object.id) own(chain, ids_->next());
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
    if (chain.id != 0 && chain.id != object.id) merge(chain.id, object.id);
  }
  // What else had its id is another thing now.
  if (ChainEntry* const other = find_chain(owners_[object.id].chain);
      other != nullptr && other->of_object != object.handle) {
    own(*other, ids_->next());
  }
  Handle chain = 0;
  const As as = as_what(object, chain);
  if (as != object.as || chain != object.chain) {
    touched_.push_back(object.id);
    for (const Handle handle : object.chains) {
      if (find_chain(handle)->id != 0) touched_.push_back(find_chain(handle)->id);
    }
  }
  object.as = as;
  object.chain = chain;
  for (const Handle handle : object.chains) {
    const FeatureId of_chain = find_chain(handle)->id;
    if (as == As::kItself && of_chain != 0 && of_chain != object.id) merge(of_chain, object.id);
  }
  if (ChainEntry* const other = find_chain(owners_[object.id].chain);
      as == As::kItself && other != nullptr && is_shown(*other)) {
    own(*other, ids_->next());  // what drives off from its boundary has its id
  }
  if (as == As::kOwnChain) own(*find_chain(chain), object.id);
  if (as != As::kItself) new_.insert(new_.end(), object.chains.begin(), object.chains.end());
  if (as == As::kPartOfChain) {
    ChainEntry& of = *find_chain(chain);
    if (id_on_map(of) == 0) own(of, ids_->next());
    merge(object.id, id_on_map(of));
  }
}

}  // namespace situation_awareness

// SPDX-License-Identifier: BSD-3-Clause
#include "situation_awareness/map/semantic_map.hpp"

#include <algorithm>
#include <cmath>
#include <tuple>
#include <utility>

#include "chain_cover.hpp"
#include "semantic_map_parts.hpp"

namespace situation_awareness {
namespace {

/// Images in turn after which a target of a camera is one with what a laser sees, or is not any more.
constexpr int kImages = 3;
/// m. From the middle of a vehicle to the side of it that a laser sees, at most; and diagonals of what may be one.
constexpr double kHalfVehicle_m = 1.2, kLeastVehicle_m = 1.2, kMostVehicle_m = 9.0;
/// Of the place of a target.
constexpr double kPlaceSigmas = 2.0;

/// Distance of a target from what a laser saw of a vehicle, 0 within its extent.
double apart_m(const GridTarget& target, const Eigen::AlignedBox2d& box_world_m) {
  return std::sqrt(box_world_m.squaredExteriorDistance(Eigen::Vector2d(target.p_world_m.head<2>())));
}

bool are_beside(const GridTarget& target, const Eigen::AlignedBox2d& box_world_m) {
  const double sigma_m = std::sqrt(std::max(0.0, target.covariance_m2.diagonal().maxCoeff()));
  return apart_m(target, box_world_m) <= kHalfVehicle_m + kPlaceSigmas * sigma_m;
}

bool is_vehicle_size(const Eigen::AlignedBox2d& box_world_m) {
  const double diagonal_m = box_world_m.diagonal().norm();
  return diagonal_m >= kLeastVehicle_m && diagonal_m <= kMostVehicle_m;
}

bool may_be_vehicle(const Object& object) {
  return !is_moving(object) && object.object_class != ObjectClass::kPerson &&
         object.object_class != ObjectClass::kPole && is_vehicle_size(box_around(object, 0.0));
}

}  // namespace

/// The rule of what a camera and a laser see: a target and a standing feature of vehicle size are one once some images
/// in turn show it there, and two again after as many that do not.
void SemanticMap::take_targets(const GridTargets& targets) {
  for (const GridTarget& target : targets.targets) {
    TargetEntry* known = find_target(target.id);
    if (known == nullptr) {
      known = &add_at_handle(targets_, target.id);
      const FeatureId saved = id_of_saved(target);
      known->id = saved != 0 ? saved : ids_->next();
      known->first_seen_ns = targets.stamp_ns;
      owners_[known->id].target = known->handle;
    }
    known->latest = target;
    known->last_seen_ns = targets.stamp_ns;
    known->update = updates_;
    touched_.push_back(known->id);
  }
  for (const TargetEntry& target : targets_) {
    if (target.update == updates_) continue;
    owners_[target.id].target = 0;
    touched_.push_back(target.id);
  }
  targets_.erase(std::remove_if(targets_.begin(), targets_.end(),
                                [this](const TargetEntry& target) { return target.update != updates_; }),
                 targets_.end());
  pairs_.clear();
  for (TargetEntry& target : targets_) {
    const Owner& owner = owners_[target.id];
    if (owner.object == 0 && owner.chain == 0) {
      find_pairs(target);
    } else if (is_one(target)) {
      target.contradicted = 0;
    } else if (++target.contradicted >= kImages) {
      part(target);
    }
  }
  std::sort(pairs_.begin(), pairs_.end(), [](const Pair& a, const Pair& b) {
    return std::tie(a.apart_m, a.target, a.feature) < std::tie(b.apart_m, b.target, b.feature);
  });
  // One to one, the nearest first.
  while (!pairs_.empty()) {
    const Pair pair = pairs_.front();
    pairs_.erase(
        std::remove_if(pairs_.begin(), pairs_.end(),
                       [&](const Pair& other) { return other.target == pair.target || other.feature == pair.feature; }),
        pairs_.end());
    TargetEntry& target = *find_target(pair.target);
    target.agreed = target.candidate == pair.feature ? target.agreed + 1 : 1;
    target.candidate = pair.feature;
    if (target.agreed >= kImages) make_one(target, pair.feature);
  }
}

/// Appends to pairs_.
void SemanticMap::find_pairs(const TargetEntry& target) {
  const auto add = [&](FeatureId id, const Eigen::AlignedBox2d& box_world_m) {
    if (id == 0 || owners_[id].target != 0 || !are_beside(target.latest, box_world_m)) return;
    pairs_.push_back({(box_world_m.center() - target.latest.p_world_m.head<2>()).norm(), target.handle, id});
  };
  for (const ObjectEntry& object : objects_) {
    if (object.as == As::kItself && may_be_vehicle(object.latest)) add(object.id, box_around(object.latest, 0.0));
  }
  const Eigen::Vector2d reach_m = Eigen::Vector2d::Constant(kMostVehicle_m);
  const Eigen::Vector2d p_m = target.latest.p_world_m.head<2>();
  find_near(Eigen::AlignedBox2d(p_m - reach_m, p_m + reach_m));
  for (const Handle handle : near_) {
    const ChainEntry& chain = *find_chain(handle);
    if (is_shown(chain) && chain.of_boundary == 0 && is_vehicle_size(chain.box_world_m))
      add(chain.id, chain.box_world_m);
  }
}

/// Whether it is still where the rest of its feature is.
bool SemanticMap::is_one(const TargetEntry& target) const {
  const Owner& owner = owners_.at(target.id);
  const ObjectEntry* const object = find_object(owner.object);
  const ChainEntry* const chain = find_chain(owner.chain);
  return (object != nullptr && !is_moving(object->latest) &&
          are_beside(target.latest, box_around(object->latest, 0.0))) ||
         (chain != nullptr && are_beside(target.latest, chain->box_world_m));
}

/// The older id stays.
void SemanticMap::make_one(TargetEntry& target, FeatureId id) {
  target.agreed = target.contradicted = 0;
  target.candidate = 0;
  if (id < target.id) {
    owners_[target.id].target = 0;
    merge(target.id, id);
    target.id = id;
    owners_[id].target = target.handle;
  } else {
    Owner& from = owners_[id];
    Owner& to = owners_[target.id];
    if (ObjectEntry* const object = find_object(from.object)) object->id = target.id;
    if (ChainEntry* const chain = find_chain(from.chain)) chain->id = target.id;
    for (Parked& parked : parked_) {
      if (parked.id == id) parked.id = target.id;
    }
    to.object = std::exchange(from.object, 0);
    to.chain = std::exchange(from.chain, 0);
    merge(id, target.id);
  }
  touched_.push_back(target.id);
}

void SemanticMap::part(TargetEntry& target) {
  target.contradicted = 0;
  owners_[target.id].target = 0;
  touched_.push_back(target.id);
  target.id = ids_->next();
  owners_[target.id].target = target.handle;
  touched_.push_back(target.id);
}

}  // namespace situation_awareness

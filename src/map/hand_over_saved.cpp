// SPDX-License-Identifier: BSD-3-Clause
#include "situation_awareness/map/semantic_map.hpp"

#include <algorithm>
#include <cstddef>
#include <variant>
#include <vector>

#include "chain_cover.hpp"
#include "semantic_map_parts.hpp"
#include "situation_awareness/common/time.hpp"

namespace situation_awareness {
namespace {

/// Features of a file that one scan asks for whether its beams pass them.
constexpr std::size_t kLookedThrough = 16;
/// m. What a layer sees anew may be so much farther beside its place in the file.
constexpr double kBesideSaved_m = 0.3;
/// Part of a chain that covers what a file has there, of which the chain is then.
constexpr double kIsOfSaved = 0.5;
/// Part of the lesser width of that, of which a chain that is larger is then all.
constexpr double kCoversSaved = 0.5;

bool may_be_same(ObjectClass a, ObjectClass b) {
  return a == b || a == ObjectClass::kUnknown || b == ObjectClass::kUnknown;
}

}  // namespace

void SemanticMap::resume(const Map& saved, const std::vector<FeatureOfChain>& chains) {
  begin_anew();
  stamp_ns_ = saved.stamp_ns;
  height_world_m_ = saved.height_world_m;
  auto of_chain = chains.begin();
  for (const Feature& feature : saved.features) {
    Owner& owner = owners_[feature.id];
    owner.last_absent_ns = feature.last_absent_ns;
    owner.object_class = feature.object_class;
    owner.p_class = feature.p_class;
    owner.is_fixed = feature.motion == Motion::kFixed;
    owner.has_moved = !owner.is_fixed && seconds_between(feature.first_seen_ns, feature.last_seen_ns) >= kFixed_s;
    if (of_chain != chains.end() && of_chain->feature == feature.id) {
      saved_ids_[of_chain->chain] = feature.id;
      if (of_chain->is_boundary) saved_boundaries_.push_back(of_chain->chain);
      ++of_chain;
      continue;
    }
    Saved& kept = saved_.emplace_back();
    kept.feature = feature;
    kept.feature.seen_by.file = true;
    const MapLayers layers = layers_of({saved.stamp_ns, 0, saved.height_world_m, {feature}});
    if (!layers.objects.objects.empty()) kept.body = layers.objects.objects.front();
    touch_saved_.push_back(feature.id);
  }
}

/// The feature of a file with an id; null if it is none, or has become what a layer sees.
const Feature* SemanticMap::find_saved(FeatureId id) const {
  const auto saved = std::lower_bound(saved_.begin(), saved_.end(), id, [](const Saved& candidate, FeatureId wanted) {
    return candidate.feature.id < wanted;
  });
  return saved != saved_.end() && saved->feature.id == id ? &saved->feature : nullptr;
}

/// Takes a feature of the file off those that no layer has seen yet, and returns its id; 0 for the end of them.
FeatureId SemanticMap::take_saved(std::vector<Saved>::const_iterator saved) {
  if (saved == saved_.end()) return 0;
  const FeatureId id = saved->feature.id;
  saved_.erase(saved);
  return id;
}

/// The id of what a file has where a new object is; 0 if there is none.
FeatureId SemanticMap::id_of_saved(const Object& object) {
  return take_saved(std::find_if(saved_.begin(), saved_.end(), [&](const Saved& saved) {
    return saved.body && may_be_same(saved.body->object_class, object.object_class) &&
           (covers(*saved.body, object.ellipse_world.center_m, margin_of(object, kBesideSaved_m)) ||
            covers(object, saved.body->ellipse_world.center_m, margin_of(object, kBesideSaved_m)));
  }));
}

/// The id of what a file has where a new target is; 0 if there is none.
FeatureId SemanticMap::id_of_saved(const GridTarget& target) {
  return take_saved(std::find_if(saved_.begin(), saved_.end(), [&](const Saved& saved) {
    const auto* const footprint = std::get_if<FootprintShape>(&saved.feature.shape);
    const Eigen::Vector2d p_world_m = target.p_world_m.head<2>();
    return footprint != nullptr && box_around(saved.feature.shape).contains(p_world_m);
  }));
}

/// What a file has where a chain is that it has not is that chain, or a part of it.
void SemanticMap::take_saved_of(ChainEntry& chain) {
  for (std::size_t k = 0; k < saved_.size();) {
    const Saved& saved = saved_[k];
    const double margin_m = saved.body ? margin_of(*saved.body, params_.margin_m) : 0.0;
    const bool is_near = saved.body && with_chains_ && box_around(*saved.body, margin_m).intersects(chain.box_world_m);
    const double on_m = is_near ? length_on(*saved.body, chain.latest, margin_m) : 0.0;
    const bool is_of_it = on_m > 0.0 && on_m >= kIsOfSaved * chain.length_m;
    if (!is_of_it && (on_m <= 0.0 || on_m < kCoversSaved * lesser_width_of(*saved.body))) {
      ++k;
      continue;
    }
    const FeatureId id = take_saved(saved_.begin() + static_cast<std::ptrdiff_t>(k));
    touched_.push_back(id);
    if (is_of_it && chain.id == 0) {
      own(chain, id);
    } else {
      if (chain.id == 0) own(chain, ids_->next());
      merge(id, chain.id);
    }
  }
}

/// What beams pass is not there any more. A scan looks at some of them, in turn.
void SemanticMap::look_through_saved() {
  for (std::size_t n = std::min(kLookedThrough, saved_.size()); n > 0 && !saved_.empty(); --n) {
    next_saved_ = next_saved_ < saved_.size() ? next_saved_ : 0;
    const Feature& feature = saved_[next_saved_].feature;
    if (!sights_.first_free_ns(points_along(feature.shape), feature.last_seen_ns)) {
      ++next_saved_;
      continue;
    }
    const FeatureId id = feature.id;
    remember_last(id);
    owners_[id].reason = GoneReason::kSeenThrough;
    touched_.push_back(id);
    take_saved(saved_.begin() + static_cast<std::ptrdiff_t>(next_saved_));
  }
}

}  // namespace situation_awareness

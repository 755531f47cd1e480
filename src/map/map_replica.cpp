// SPDX-License-Identifier: BSD-3-Clause
#include "situation_awareness/map/map_replica.hpp"

#include <algorithm>
#include <utility>

namespace situation_awareness {

MapReplica::Verdict MapReplica::apply(const MapDelta& update) {
  const bool is_of_this_map = map_ && *map_ == update.map;
  if (is_of_this_map && update.version <= version_) return Verdict::kKnown;
  if (!update.full && !(is_of_this_map && update.base == version_)) return Verdict::kMissed;
  map_ = update.map;
  version_ = update.version;
  all_.stamp_ns = update.stamp_ns;
  all_.objects_stamp_ns = update.objects_stamp_ns;
  all_.height_world_m = update.height_world_m;
  if (update.full) {
    all_.features = update.changed;
    return Verdict::kTaken;
  }
  merged_.clear();
  auto changed = update.changed.begin();
  auto gone = update.gone.begin();
  for (Feature& feature : all_.features) {
    for (; changed != update.changed.end() && changed->id < feature.id; ++changed) merged_.push_back(*changed);
    while (gone != update.gone.end() && gone->id < feature.id) ++gone;
    if (changed != update.changed.end() && changed->id == feature.id) {
      merged_.push_back(*changed++);
    } else if (gone == update.gone.end() || gone->id != feature.id) {
      merged_.push_back(std::move(feature));
    }
  }
  merged_.insert(merged_.end(), changed, update.changed.end());
  std::swap(all_.features, merged_);
  return Verdict::kTaken;
}

const Feature* MapReplica::find(FeatureId id) const {
  const auto place = std::lower_bound(all_.features.begin(), all_.features.end(), id,
                                      [](const Feature& feature, FeatureId other) { return feature.id < other; });
  return place != all_.features.end() && place->id == id ? &*place : nullptr;
}

}  // namespace situation_awareness

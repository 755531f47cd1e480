// SPDX-License-Identifier: BSD-3-Clause
#include "situation_awareness/map/pending_changes.hpp"

#include <utility>

namespace situation_awareness {

void PendingChanges::add(const MapDelta& delta) {
  const bool follows = !delta.full && delta.map == sum_.map && delta.base == sum_.version;
  if (!follows) {
    clear();
    sum_.map = delta.map;
    sum_.base = delta.base;
    sum_.full = delta.full;
  }
  sum_.stamp_ns = delta.stamp_ns;
  sum_.objects_stamp_ns = delta.objects_stamp_ns;
  sum_.height_world_m = delta.height_world_m;
  sum_.version = delta.version;
  for (const Gone& gone : delta.gone) {
    changed_.erase(gone.id);
    gone_[gone.id] = gone;
  }
  for (const Feature& feature : delta.changed) {
    gone_.erase(feature.id);
    changed_[feature.id] = feature;
  }
}

MapDelta PendingChanges::take() {
  MapDelta sum = sum_;
  for (auto& [id, feature] : changed_) sum.changed.push_back(std::move(feature));
  for (const auto& [id, gone] : gone_) sum.gone.push_back(gone);
  changed_.clear();
  gone_.clear();
  sum_.base = sum_.version;
  sum_.full = false;
  return sum;
}

}  // namespace situation_awareness

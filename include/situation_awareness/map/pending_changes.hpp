// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstdint>
#include <map>

#include "situation_awareness/map/map.hpp"

namespace situation_awareness {

/// What has changed on a map since it was last told to someone who is told less often than it changes. Who applies the
/// sums (MapReplica) has the same map as who applies each update, after each of them.
class PendingChanges {
 public:
  /// Adds the next update of the map. After one that does not follow on the one before, the sum begins with it.
  void add(const MapDelta& delta);

  /// The sum of all that was added since the last call, in the version of the latest one. The next one follows on it.
  MapDelta take();

  /// Forgets everything, as if nothing had been added yet.
  void clear() { *this = PendingChanges(); }

 private:
  MapDelta sum_;  ///< without `changed` and `gone`
  std::map<FeatureId, Feature> changed_;
  std::map<FeatureId, Gone> gone_;
};

}  // namespace situation_awareness

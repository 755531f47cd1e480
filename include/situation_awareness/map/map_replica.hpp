// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstddef>
#include <cstdint>
#include <optional>
#include <vector>

#include "situation_awareness/map/map.hpp"

namespace situation_awareness {

/// A copy of a map that is kept by its updates, by who has nothing else of it.
class MapReplica {
 public:
  /// What an update was to the copy.
  enum class Verdict : std::uint8_t {
    kTaken,
    kKnown,   ///< the copy has it already
    kMissed,  ///< it begins at another version than that of the copy, or is of another map: a full one is needed
  };

  /// Takes an update over; of kKnown and kMissed the copy stays as it is.
  Verdict apply(const MapDelta& update);

  /// Whether there has been a full update.
  bool has_map() const { return map_.has_value(); }

  /// By ascending id.
  const Map& map() const { return all_; }

  /// Null if it is not on the map.
  const Feature* find(FeatureId id) const;

 private:
  std::optional<std::uint64_t> map_;  ///< number of the map
  std::uint64_t version_ = 0;
  Map all_;
  std::vector<Feature> merged_;  ///< for its memory
};

}  // namespace situation_awareness

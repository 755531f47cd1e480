// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <algorithm>
#include <cstdint>

#include "situation_awareness/common/time.hpp"
#include "situation_awareness/map/objects/objects.hpp"
#include "situation_awareness/map/polygons/polygons.hpp"

// Common to the sources of SemanticMap.
namespace situation_awareness {

inline bool is_moving(const Object& object) { return object.p_moving > 0.5; }

/// s. What stands for so long, and was never seen to move, is fixed.
constexpr double kFixed_s = 60.0;

/// Whether it has stood so long, or since before the present transit, by which its layer knows it.
inline bool has_stood_long(const Chain& chain) {
  return chain.state == ChainState::kWall || chain.state == ChainState::kKnown ||
         seconds_between(chain.first_seen_ns, chain.last_seen_ns) >= kFixed_s;
}

/// In a list by ascending handle; null if it is not there.
template <class List>
auto at_handle(List& list, std::uint64_t handle) {
  const auto place = std::lower_bound(list.begin(), list.end(), handle,
                                      [](const auto& entry, std::uint64_t wanted) { return entry.handle < wanted; });
  return place != list.end() && place->handle == handle ? &*place : nullptr;
}

/// At its place in such a list, a new one.
template <class List>
auto& add_at_handle(List& list, std::uint64_t handle) {
  auto place = std::lower_bound(list.begin(), list.end(), handle,
                                [](const auto& entry, std::uint64_t wanted) { return entry.handle < wanted; });
  place = list.emplace(place);
  place->handle = handle;
  return *place;
}

}  // namespace situation_awareness

// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <utility>

#include "situation_awareness/map/polygons/polygon_map.hpp"

namespace situation_awareness {

/// Makes the chains that a scan changed. A map of an older build has one way, that makes all chains anew.
template <class Map>
auto make_chains(Map& map, Polygons& /*memory*/, int /*preferred*/) -> decltype(map.update_due_chains(), void()) {
  map.update_due_chains();
}
template <class Map>
void make_chains(Map& map, Polygons& memory, long /*older*/) {
  memory = map.polygons(std::move(memory));
}

}  // namespace situation_awareness

// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <utility>

#include "situation_awareness/map/polygons/polygon_map.hpp"

namespace situation_awareness {

// The benchmarks are also built with the library of an older commit (scripts/evaluation/speed_of_maps.py). What is
// called otherwise there has a function here: its last argument is 0, for which int is preferred to long where both can
// be called.

/// Makes the chains that a scan changed. A map of an older build has one way, that makes all chains anew.
template <class Map>
auto make_chains(Map& map, Polygons& /*memory*/, int /*preferred*/) -> decltype(map.update_due_chains(), void()) {
  map.update_due_chains();
}
template <class Map>
void make_chains(Map& map, Polygons& memory, long /*older*/) {
  memory = map.polygons(std::move(memory));
}

/// Lays the elements of an empty map along these chains. A map of an older build takes a snapshot that has them.
template <class Map, class Chains>
auto restore_chains(Map& map, const Chains& chains, int /*preferred*/) -> decltype(map.restore(chains)) {
  map.restore(chains);
}
template <class Map, class Chains>
void restore_chains(Map& map, const Chains& chains, long /*older*/) {
  map.restore(snapshot_of_chains(chains, PolygonMapParams{}.spacing_m));
}

/// Fits a closed boundary. An older fit takes the variance of an error that all elements share.
template <class Fit, class Elements, class Vertices>
auto fit_closed(Fit& fit, const Elements& elements, Vertices& vertices, int /*preferred*/)
    -> decltype(fit.fit(elements, true, vertices)) {
  return fit.fit(elements, true, vertices);
}
template <class Fit, class Elements, class Vertices>
auto fit_closed(Fit& fit, const Elements& elements, Vertices& vertices, long /*older*/)
    -> decltype(fit.fit(elements, true, 0.0, vertices)) {
  return fit.fit(elements, true, 0.0, vertices);
}

/// Prepares the search for a pose by the reflectors of a map. An older search takes parameters, here the defaults.
template <class Search, class Map>
auto search_on(const Map& map, int /*preferred*/) -> decltype(Search(map)) {
  return Search(map);
}
template <class Search, class Map>
auto search_on(const Map& map, long /*older*/) -> decltype(Search(map, {})) {
  return Search(map, {});
}

}  // namespace situation_awareness

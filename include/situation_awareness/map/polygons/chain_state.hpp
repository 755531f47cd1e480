// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstdint>

#include "situation_awareness/common/params.hpp"
#include "situation_awareness/map/polygons/polygons.hpp"

namespace situation_awareness {

/// Parameters of the states of chains.
struct ChainStateParams {
  double wall_extent_m = 1.6;
  double known_s = 60.0;
  double doubted_p = 0.75;

  template <class Self, class Visit>
  static void fields(Self& self, Visit&& visit) {
    visit("wall_extent_m", self.wall_extent_m, Bounds{0.01, 1000.0}, "m",
          "a chain with a larger distance between two of its vertices is a wall, once it is known");
    visit("known_s", self.known_s, Bounds{0.0, 1e6}, "s",
          "a chain is known from this time after its first sight, or from the next transit on");
    visit("doubted_p", self.doubted_p, Bounds{0.5, 1.0}, "",
          "a chain is doubted while the probability of existence of its least certain part is below this");
  }

  /// Throws std::invalid_argument naming field and bound.
  void validate() const { check_bounds(*this, "chain_states"); }
};

/// Largest distance between two vertices; with `enough_m` the search ends at the first distance above it.
double extent_m(const Chain& chain, double enough_m = 1e300);

/// The state of a chain at `stamp_ns`, of a transit that began at `transit_ns` (docs/math/polygons.md, "States").
/// Invariant under rigid motion and a shift of all times.
ChainState state_of(const Chain& chain, std::int64_t stamp_ns, std::int64_t transit_ns, const ChainStateParams& params);

}  // namespace situation_awareness

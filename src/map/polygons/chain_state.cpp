// SPDX-License-Identifier: BSD-3-Clause
#include "situation_awareness/map/polygons/chain_state.hpp"

#include <algorithm>
#include <cmath>
#include <cstddef>

#include "situation_awareness/common/time.hpp"

namespace situation_awareness {

double extent_m(const Chain& chain, double enough_m) {
  double largest_m = 0.0;
  for (std::size_t i = 0; i < chain.vertices.size(); ++i) {
    for (std::size_t k = 0; k < i; ++k) {
      largest_m = std::max(largest_m, (chain.vertices[i].p_world_m - chain.vertices[k].p_world_m).norm());
      if (largest_m > enough_m) return largest_m;
    }
  }
  return largest_m;
}

ChainState state_of(const Chain& chain, std::int64_t stamp_ns, std::int64_t transit_ns,
                    const ChainStateParams& params) {
  if (chain.p_exists < params.doubted_p) return ChainState::kDoubted;
  const bool is_known =
      chain.first_seen_ns < transit_ns || seconds_between(chain.first_seen_ns, stamp_ns) > params.known_s;
  if (!is_known) return ChainState::kNew;
  return extent_m(chain, params.wall_extent_m) > params.wall_extent_m ? ChainState::kWall : ChainState::kKnown;
}

}  // namespace situation_awareness

// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <vector>

#include "situation_awareness/map/map.hpp"
#include "situation_awareness/map/splinegons/splinegons.hpp"

namespace situation_awareness {

/// The outlines of large obstacles on a map, counter-clockwise around them, by ascending id: its boundaries, and those
/// of its polylines of which the box around them has a diagonal of `min_extent_m` at least. `memory`: a result no
/// longer needed, whose memory this one reuses.
std::vector<Splinegon> outlines_of_large_obstacles(const Map& map, double min_extent_m,
                                                   std::vector<Splinegon> memory = {});

}  // namespace situation_awareness

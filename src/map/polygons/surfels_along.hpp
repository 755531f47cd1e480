// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <vector>

#include "situation_awareness/map/polygons/polygons.hpp"
#include "situation_awareness/map/polygons/surfels.hpp"

namespace situation_awareness {

/// Elements `spacing_m` apart along the edges of these chains, confirmed, as certain as the chains are, and named after
/// them. Throws std::invalid_argument if they would be more than PolygonMap::kMaxElements, or a chain has a place more
/// than 1000 km from the origin, a standard deviation that is no size, or a stamp after that of the polygons or more
/// than 73 years before it.
std::vector<Surfel> surfels_along(const Polygons& polygons, double spacing_m);

}  // namespace situation_awareness

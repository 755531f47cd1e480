// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <string>
#include <vector>

#include <situation_awareness/GoneFeature.h>
#include <situation_awareness/MapUpdate.h>

#include "situation_awareness/map/map.hpp"

namespace situation_awareness {

/// `uuid`: of the map.
MapUpdate map_delta_to_msg(const MapDelta& delta, const std::string& uuid, const std::string& world_frame);

std::vector<GoneFeature> gone_to_msg(const std::vector<Gone>& gone);

/// The number of the map is made of its UUID. Throws std::invalid_argument if a number is not finite, a probability is
/// outside [0, 1], an id is 0 or ids do not ascend, an outline has too few vertices or not all numbers for each, an
/// extent is not positive, or a kind, class, motion or reason is unknown.
MapDelta map_delta_from_msg(const MapUpdate& msg);

}  // namespace situation_awareness

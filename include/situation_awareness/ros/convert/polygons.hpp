// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <string>

#include <situation_awareness/PolygonArray.h>

#include "situation_awareness/map/polygons/polygons.hpp"

namespace situation_awareness {

PolygonArray polygons_to_msg(const Polygons& polygons, const std::string& world_frame);

/// Throws std::invalid_argument if a number is not finite, a chain has fewer than two vertices or not one sigma_m > 0
/// for each, a probability is outside [0, 1], an id is 0 or there twice, or a state is unknown. The height of an empty
/// map is 0, since the message has it per vertex.
Polygons polygons_from_msg(const PolygonArray& msg);

}  // namespace situation_awareness

// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <string>

#include <situation_awareness/SplinegonArray.h>

#include "situation_awareness/map/splinegons/splinegons.hpp"

namespace situation_awareness {

SplinegonArray splinegons_to_msg(const Splinegons& splinegons, const std::string& world_frame);

/// Throws std::invalid_argument if a number is not finite, a boundary has fewer than three vertices, or closed four, or
/// not one bulge, sigma_m >= 0 and corner for each, or an id is 0 or there twice. The height without boundaries is 0,
/// since the message has it per vertex.
Splinegons splinegons_from_msg(const SplinegonArray& msg);

}  // namespace situation_awareness

// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include "situation_awareness/map/objects/objects.hpp"

namespace situation_awareness {

/// True for a velocity that its own uncertainty (95 %) does not explain.
bool moves(const Object& object);

/// The 95 % ellipse of the centre's error about the centre, in the world. What a covariance has of negative variance,
/// by rounding, counts as none.
Ellipse position_uncertainty(const Object& object);

}  // namespace situation_awareness

// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <string>

#include "situation_awareness/map/objects/objects.hpp"

namespace situation_awareness {

/// Slower objects are drawn as standing.
constexpr double kMinDrawnSpeed_m_s = 0.05;

/// True for a velocity that is significant at 95 %, and not too low to be drawn.
bool moves(const Object& object);

/// The 95 % ellipse of the centre's error about the centre, in the world. Negative variances by rounding count as zero.
Ellipse position_uncertainty(const Object& object);

/// " person 93 %", with a space before it; empty for an unknown class.
std::string class_text(const Object& object);

}  // namespace situation_awareness

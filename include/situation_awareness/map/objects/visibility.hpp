// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include "situation_awareness/geometry/ellipse.hpp"
#include "situation_awareness/points/points.hpp"

namespace situation_awareness {

/// What the beams of one scan say of a place where an element should be.
enum class Sight {
  kSeenThrough,  ///< most of them went through it: it is not there
  kHit,          ///< most of them ended there
  kHidden,       ///< something nearer hides it, or no beam went its way
};

/// Look at the middle of an ellipse of the level frame: beams within the inner half of its silhouette count, so that an
/// error of its place does not let beams pass beside it. A beam went through if it ended more than `margin_m` behind
/// the ellipse, and was stopped before if it ended more than that in front of it. The cost is that of the beams on it.
Sight look_at(const Ellipse& ellipse_level, const FreeSpace& free_space, double margin_m);

}  // namespace situation_awareness

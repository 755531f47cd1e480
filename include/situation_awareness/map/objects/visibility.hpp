// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include "situation_awareness/geometry/ellipse.hpp"
#include "situation_awareness/points/points.hpp"

namespace situation_awareness {

/// Visibility of a place where an element is expected, by the beams of one scan.
enum class Sight {
  kSeenThrough,  ///< most of them passed through it: it is not there
  kHit,          ///< most of them ended there
  kHidden,       ///< something nearer hides it, or no beam points there
};

/// Visibility of an ellipse in the level frame: only beams within the inner half of its silhouette are used, so that an
/// error of its position does not let beams pass beside it. A beam passed through if it ended more than `margin_m`
/// behind the ellipse, and was blocked if it ended more than that in front of it. The cost is linear in the beams on
/// it.
Sight look_at(const Ellipse& ellipse_level, const FreeSpace& free_space, double margin_m);

}  // namespace situation_awareness

// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <vector>

#include "boundary_corners.hpp"
#include "boundary_elements.hpp"
#include "stations.hpp"

namespace situation_awareness {

/// Corners, and between them the places at which one arc meets the elements no longer, along the polygon of the
/// elements. Overwrites `arc_ends`.
void find_arc_ends(const BoundaryElements& elements, const std::vector<BoundaryCorner>& corners,
                   std::vector<Station>& arc_ends);

}  // namespace situation_awareness

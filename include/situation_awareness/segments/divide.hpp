// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <vector>

#include "situation_awareness/geometry/expected_outline.hpp"
#include "situation_awareness/segments/segmentation.hpp"
#include "situation_awareness/segments/segments.hpp"

namespace situation_awareness {

/// Divide segments that hold more than one object by the expected outlines: two persons who meet, a barrel against a
/// wall, an arm before its torso.
///
/// `known_level` are the outlines of known objects, predicted to the time of the scan, in the level frame. A hit within
/// params.max_division_offset_m of an outline is assigned to that object. A segment is divided where the assignment
/// changes, if it holds two known objects, or one and other hits that stick out of it, and only where it is not convex;
/// pieces with fewer than params.min_points hits are dropped. Assigned pieces become objects unless they are flat; the
/// rest keeps the kind of the whole. Hits beside all outlines are never assigned, so an empty list changes nothing.
Segments divide(Segments segments, const std::vector<ExpectedOutline>& known_level, const SegmentationParams& params);

}  // namespace situation_awareness

// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <vector>

#include "situation_awareness/geometry/ellipse.hpp"
#include "situation_awareness/segments/segmentation.hpp"
#include "situation_awareness/segments/segments.hpp"

namespace situation_awareness {

/// Divide segments that hold more than one thing, as far as it is known what to expect there: two persons who meet, a
/// barrel against a wall, an arm before its torso.
///
/// `known_level` are the outlines of known objects, predicted to the time of the scan, in the level frame. A hit within
/// params.max_division_offset_m of an outline is that object's. A segment is divided where its hits change owner, if it
/// holds two known objects, or one and something else that sticks out of it, and only where its outline is not convex;
/// pieces with fewer than params.min_points hits are dropped. What is known becomes an object's segment unless it is
/// flat; the rest keeps the kind of the whole. Hits of nothing known are never taken for something that is, so an empty
/// list changes nothing.
Segments divide(Segments segments, const std::vector<Ellipse>& known_level, const SegmentationParams& params);

}  // namespace situation_awareness

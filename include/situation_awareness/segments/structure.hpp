// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstddef>

#include "situation_awareness/points/points.hpp"
#include "situation_awareness/segments/segmentation.hpp"
#include "situation_awareness/segments/segments.hpp"

namespace situation_awareness {

/// Why a segment is structure by its own hits and ends, whatever is beside it; kNone if it may be an object. `segment`
/// need not be one of `segments`, but its points are.
StructureReason structure_reason(const Segments& segments, const Segment& segment, const SegmentationParams& params);

/// Say of every segment whether it may be an object or is structure, and why (docs/math/segments.md, "Structure"), by
/// its own hits and by the structures that it is in line with. Each structure is counted by its reason in
/// Segments::refused. What the segments were said to be before does not matter.
Segments classify_structure(Segments segments, const SegmentationParams& params);

/// Mean distance of points in reading order behind the chord of their ends, as seen from the sensor; negative in front
/// of it, as on any convex thing.
double concavity_m(const Point* points, std::size_t count);

/// True if a segment is long and flat: the front of a wall or a cabinet, whatever else speaks for an object.
bool is_flat(const Segments& segments, const Segment& segment, const SegmentationParams& params);

}  // namespace situation_awareness

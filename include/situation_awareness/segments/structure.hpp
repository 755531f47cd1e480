// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstddef>

#include "situation_awareness/points/points.hpp"
#include "situation_awareness/segments/segmentation.hpp"
#include "situation_awareness/segments/segments.hpp"

namespace situation_awareness {

/// m. A partially occluded segment with all points within this distance of the line of a neighbouring structure is part
/// of that structure. No source is recorded, and its sensitivity was not measured.
constexpr double kMaxStructureOffset_m = 0.06;

/// Reason why a segment is structure by its own hits and ends, without its neighbours; kNone if it may be an object.
/// `segment` need not be one of `segments`, but its points are, and their range noise is known.
StructureReason structure_reason(const Segments& segments, const Segment& segment, const SegmentationParams& params);

/// Classify every segment as object or structure, with the reason (docs/math/segments.md, "Structure"), by its own hits
/// and by structures in line with it, and measure the range noise. Structures are counted by reason in
/// Segments::refused. Earlier classifications have no effect.
Segments classify_structure(Segments segments, const SegmentationParams& params);

/// Mean distance of points in reading order behind the chord of their ends, as seen from the sensor; negative in front
/// of it, as on convex objects.
double concavity_m(const Point* points, std::size_t count);

/// True if a segment is long and flat: the front of a wall or a cabinet, regardless of other criteria.
bool is_flat(const Segments& segments, const Segment& segment, const SegmentationParams& params);

}  // namespace situation_awareness

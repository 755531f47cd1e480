// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstddef>

#include <Eigen/Core>

#include "situation_awareness/geometry/line.hpp"
#include "situation_awareness/points/points.hpp"
#include "situation_awareness/segments/segmentation.hpp"
#include "situation_awareness/segments/segments.hpp"

namespace situation_awareness {

/// The line through points by unweighted total least squares. At least one point; the normal has either sign.
Line fit_line(const Point* points, std::size_t count);

/// Root mean square distance of points from a line.
double rms_m(const Line& line, const Point* points, std::size_t count);

/// Bulge of points along a line: the rise from their ends to the middle, towards the sensor.
struct Bulge {
  double ratio = 0.0;   ///< of a parabola over the line, as a fraction of half_m
  double half_m = 0.0;  ///< half the length of the points along the line
};

Bulge bulge_of(const Line& line, const Point* points, std::size_t count);

/// Find the straight pieces of the structures among `segments`, into Segments::straight_pieces: runs of at least
/// params.min_line_points hits within params.max_line_offset_m of a line, except for runs of fewer hits off it.
/// Replaces earlier pieces. The time per piece is linear in the points.
Segments with_straight_pieces(Segments segments, const SegmentationParams& params, double range_sigma_m);

}  // namespace situation_awareness

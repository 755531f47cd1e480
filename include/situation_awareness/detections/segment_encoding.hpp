// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <array>
#include <cstddef>

#include "situation_awareness/detections/detections.hpp"
#include "situation_awareness/geometry/ellipse.hpp"
#include "situation_awareness/segments/segments.hpp"

namespace situation_awareness {

/// A segment as input of the ellipse network: its profile over its visible angle, in units of its half width, and
/// further features. Rotating the scene changes only the frame, and scaling everything, noise and radii included,
/// changes only the unit (docs/math/detections.md).
struct SegmentEncoding {
  static constexpr std::size_t kSlots = 32;
  static constexpr std::size_t kScalars = 12;
  static constexpr std::size_t kInputs = kSlots + kScalars;

  std::array<float, kInputs> inputs{};
  double azimuth_rad = 0.0;   ///< of the middle of the visible angle: the x axis of the segment's frame
  double mean_range_m = 0.0;  ///< mean of the profile
  double half_width_m = 0.0;  ///< half of the visible width across the line of sight: the unit of length
};

/// `range_sigma_m`: standard deviation of the sensor's ranges; `max_radius_m`: the largest expected radius, which sets
/// the scale of the network's prior. The segment has at least two points.
SegmentEncoding encode(const Segments& segments, const Segment& segment, double range_sigma_m, double max_radius_m);

/// (t_x, t_y, m, p, q) in the segment's frame, t relative to its point at the mean range; and back to the level frame.
Vector5d to_segment_frame(const SegmentEncoding& encoding, const Ellipse& ellipse_level);
Vector5d to_level_frame(const SegmentEncoding& encoding, const Vector5d& smooth_segment);

}  // namespace situation_awareness

// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstddef>
#include <vector>

#include <Eigen/Core>

#include "situation_awareness/detections/detect_each.hpp"
#include "situation_awareness/detections/detections.hpp"
#include "situation_awareness/detections/least_squares.hpp"
#include "situation_awareness/segments/segments.hpp"

namespace situation_awareness {

/// Detects by a fit of a segment's points only, `fit(points in the level frame) -> Ellipse`; residual and covariance
/// are those of the sensor model. `points_level_m` is reused memory.
template <class Fit>
void fit_each(const Segments& segments, const EllipseFitParams& params, const Fit& fit,
              std::vector<Eigen::Vector2d>& points_level_m, Detections& found) {
  detect_each(
      segments, params,
      [&](std::size_t i) {
        const Segment& segment = segments.segments[i];
        points_level_m.clear();
        for (std::size_t k = 0; k < segment.count; ++k) {
          points_level_m.push_back(segments.points[segment.first + k].p_level_m);
        }
        return assess_ellipse(segments, i, params, fit(points_level_m));
      },
      found);
}

}  // namespace situation_awareness

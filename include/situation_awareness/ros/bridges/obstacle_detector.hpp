// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <algorithm>
#include <cmath>

#include <obstacle_detector/Obstacles.h>

#include "situation_awareness/MappedObjectArray.h"

namespace situation_awareness {

/// The map as messages of obstacle_detector: circles around the ellipses and boxes, without segments, which the map
/// does not have. `true_radius` is the longer semi-axis, or half the diagonal of a box; `radius` has the position's 95
/// % uncertainty as its margin.
inline obstacle_detector::Obstacles circles_from_map(const MappedObjectArray& map) {
  constexpr double kChiSquare95 = 5.991464547107979;  // 95 % quantile, two degrees of freedom
  obstacle_detector::Obstacles result;
  result.header = map.header;
  for (const MappedObject& element : map.objects) {
    const double xx = element.covariance[0], xy = element.covariance[1], yy = element.covariance[9];
    const double largest_variance = 0.5 * (xx + yy) + std::hypot(0.5 * (xx - yy), xy);
    obstacle_detector::CircleObstacle circle;
    circle.center = element.pose.position;
    circle.velocity = element.twist.linear;
    circle.true_radius =
        element.shape == MappedObject::BOX ? 0.5 * std::hypot(element.box_length, element.box_width) : element.rx;
    circle.radius = circle.true_radius + std::sqrt(kChiSquare95 * std::max(largest_variance, 0.0));
    result.circles.push_back(circle);
  }
  return result;
}

}  // namespace situation_awareness

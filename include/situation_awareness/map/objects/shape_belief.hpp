// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <algorithm>

#include "situation_awareness/detections/detections.hpp"
#include "situation_awareness/geometry/pose2.hpp"
#include "situation_awareness/map/objects/map_element.hpp"
#include "situation_awareness/map/objects/objects.hpp"

namespace situation_awareness {

// The shape of an element is a belief beside its estimate, which is that of the ellipse of equal moments for either
// shape: id, existence, position and velocity do not depend on it (docs/math/boxes.md).

/// m, of the mean radius. Of smaller things, such as legs, the hits tell no shape: they are ellipses.
constexpr double kLeastBox_m = 0.08;

/// Log-odds from which on a shape is known: a probability of 0.9.
constexpr double kKnownShape = 2.2;

/// True if a box is more probable than an ellipse.
inline bool is_box(const MapElement& element) {
  return element.box_log_odds > 0.0 && element.estimate.standing.x(object_state::kShape) >= kLeastBox_m;
}

/// True if one is known to be a box and the other to be an ellipse.
inline bool differ_in_shape(const MapElement& a, const MapElement& b) {
  return std::min(a.box_log_odds, b.box_log_odds) < -kKnownShape &&
         std::max(a.box_log_odds, b.box_log_odds) > kKnownShape;
}

/// Update the belief by a detection, and the estimate where it turns to a box: what was seen of the ellipse was a face,
/// and how far the box extends behind it is unknown.
void shape_update(MapElement& element, const Detection& detection, const Pose2& T_world_level);

/// Covariance of the part of a detection's error that repeats from the same viewpoint: without what the view does not
/// show, which the estimate knows better.
Matrix5d view_covariance(const Detection& detection, const Matrix5d& R);

/// The likelier shape, its probability, and the box of the object's ellipse.
void fill_shape(const MapElement& element, Object& object);

}  // namespace situation_awareness

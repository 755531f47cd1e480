// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <vector>

#include "situation_awareness/map/objects/objects.hpp"
#include "situation_awareness/ros/markers/colors.hpp"
#include "situation_awareness/ros/rviz/map_history.hpp"
#include "situation_awareness/ros/rviz/map_mesh.hpp"

namespace situation_awareness {

struct ObjectStyle : MapStyle {
  enum Coloring { kId, kMotion, kClass, kClassOrMotion };

  Coloring coloring = kClassOrMotion;
  bool velocity = true;
  bool covariance = true;
};

/// Adds to `mesh` each element as a body about the map's height, its outline (dashed where the element has not been
/// seen for half a second), an arrow from its edge for its motion in 1 s, if it moves, the 95 % ellipse of its centre,
/// and its path, which fades with age.
void add(const Objects& map, const MapHistory& history, const ObjectStyle& style, MapMesh& mesh);

/// The colour of an element.
Color color_of(const Object& object, ObjectStyle::Coloring coloring);

/// Positions of the elements, for MapHistory.
std::vector<MapPosition> positions_of(const Objects& map);

/// Id and, where it is known, class of the elements, in their bodies, or below those that are too small.
std::vector<MapLabel> labels_of(const Objects& map, const MapStyle& style);

}  // namespace situation_awareness

// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <vector>

#include "situation_awareness/map/objects/objects.hpp"
#include "situation_awareness/ros/markers/colors.hpp"
#include "situation_awareness/ros/rviz/drawable_objects.hpp"
#include "situation_awareness/ros/rviz/map_history.hpp"
#include "situation_awareness/ros/rviz/map_mesh.hpp"

namespace situation_awareness {

/// Style of a map of objects.
struct ObjectStyle : MapStyle {
  enum Coloring { kId, kMotion, kClass, kClassOrMotion };

  bool velocity = true;
  bool covariance = true;
};

/// Draws the map: each element a body about the map's height, its outline (dashed where the element has not been seen
/// for half a second), an arrow from its edge for its motion in 1 s, if it moves, the 95 % ellipse of its centre, and
/// its path, which fades with age. `mesh` is the previous one: its memory is reused.
void draw(const Objects& map, const MapHistory& history, const ObjectStyle& style, MapMesh& mesh);

/// Adds to `mesh` what draw() draws, and keeps what the mesh has already.
void add(const Objects& map, const MapHistory& history, const ObjectStyle& style, MapMesh& mesh);

/// The colour of an element.
Color color_of(const Object& object, ObjectStyle::Coloring coloring);

/// Positions of the elements, for MapHistory.
std::vector<MapPosition> positions_of(const Objects& map);

/// The names of the elements, in their bodies, or below those that are too small.
std::vector<MapLabel> labels_of(const DrawableObjects& map, const MapStyle& style);

}  // namespace situation_awareness

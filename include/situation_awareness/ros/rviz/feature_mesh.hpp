// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstddef>
#include <vector>

#include "situation_awareness/map/map.hpp"
#include "situation_awareness/ros/rviz/map_history.hpp"
#include "situation_awareness/ros/rviz/map_mesh.hpp"
#include "situation_awareness/ros/rviz/object_mesh.hpp"

namespace situation_awareness {

/// The one map, safe for a renderer: its extents are bounded. Its boundaries are sampled as chains are.
struct DrawableMap {
  Objects objects;
  Polygons polygons, boundaries;
  GridTargets targets;
};

/// Throws std::invalid_argument naming a feature that is beyond 100 km, or whose standard deviation is beyond 1 km.
DrawableMap drawable_map(const Map& map);

/// Number of features.
std::size_t size_of(const DrawableMap& map);

struct FeatureStyle : ObjectStyle {
  double line_m = 0.08;  ///< width of lines on top of walls
};

/// Draws the map: bodies as draw() of objects, with the colour of their class, or of their motion where the class is
/// not known, or of their id; walls dark grey, what stands blue and boundaries of large obstacles teal, as draw() of
/// polygons, and filled where they are closed and small; on the ground the targets of images, each a disc of its area
/// in the region in which its centre lies with 99 %. `mesh` is the previous one: its memory is reused.
void draw(const DrawableMap& map, const MapHistory& history, const FeatureStyle& style, MapMesh& mesh);

/// The positions of the objects; no other feature has a path.
std::vector<MapPosition> positions_of(const DrawableMap& map);

/// The ids, of bodies with their class.
std::vector<MapLabel> labels_of(const DrawableMap& map, const MapStyle& style);

}  // namespace situation_awareness

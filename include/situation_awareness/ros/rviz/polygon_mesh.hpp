// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <vector>

#include <situation_awareness/PolygonArray.h>

#include "situation_awareness/map/polygons/polygons.hpp"
#include "situation_awareness/ros/markers/colors.hpp"
#include "situation_awareness/ros/rviz/map_mesh.hpp"

namespace situation_awareness {

/// Style of a map of polygons.
struct PolygonStyle : MapStyle {
  enum Coloring { kState, kId };

  bool uncertainty = true;
  double line_m = kLineWidth_m;  ///< width of the lines on top of the walls
};

/// As polygons_from_msg; it also refuses a vertex beyond 100 km and a sigma_m above 1 km, so that the map is safe for a
/// renderer.
Polygons drawable_polygons(const PolygonArray& msg);

/// Draws the map: each chain a wall about the map's height, the paler the less probable, its line on top of it, and the
/// band of 2 sigma to both sides. `mesh` is the previous one: its memory is reused.
void draw(const Polygons& map, const PolygonStyle& style, MapMesh& mesh);

/// Adds a chain of a map at this height to what the mesh has already.
void add(const Chain& chain, const Color& color, double height_m, const PolygonStyle& style, MapMesh& mesh);

/// The ids of the chains, on their free side at the middle of the edge in their middle.
std::vector<MapLabel> labels_of(const Polygons& map, const MapStyle& style);

}  // namespace situation_awareness

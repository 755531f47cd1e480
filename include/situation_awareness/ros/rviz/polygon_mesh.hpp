// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <vector>

#include "situation_awareness/map/polygons/polygons.hpp"
#include "situation_awareness/ros/markers/colors.hpp"
#include "situation_awareness/ros/rviz/map_mesh.hpp"

namespace situation_awareness {

/// Style of chains.
struct PolygonStyle : MapStyle {
  bool uncertainty = true;
  double line_m = kLineWidth_m;  ///< width of the lines on top of the walls
};

/// Adds a chain of a map at this height to what the mesh has already: a wall about that height, the paler the less
/// probable, its line on top of it, and the band of 2 sigma to both sides.
void add(const Chain& chain, const Color& color, double height_m, const PolygonStyle& style, MapMesh& mesh);

/// The ids of the chains, on their free side at the middle of the edge in their middle.
std::vector<MapLabel> labels_of(const Polygons& map, const MapStyle& style);

}  // namespace situation_awareness

// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <string>
#include <vector>

#include <visualization_msgs/MarkerArray.h>

#include "situation_awareness/map/polygons/polygons.hpp"
#include "situation_awareness/ros/markers/colors.hpp"
#include "situation_awareness/ros/markers/shown_markers.hpp"

namespace situation_awareness {

/// Wall dark grey, known blue, new green, doubted magenta: the areas before a vehicle are yellow and red.
Color color_of(ChainState state);

/// The markers that show it.
std::vector<visualization_msgs::Marker> markers_of(const Polygons& polygons, const std::string& world_frame);

/// Markers of successive maps of polygons; deletes what is gone. Namespaces: wall, known, new, doubted (one marker each
/// with all edges of such chains, since a viewer draws few large markers much faster than many small ones), id (at the
/// middle of each chain), uncertainty (bars of 2 sigma to both sides across the boundary at each vertex).
class PolygonMarkers {
 public:
  /// The markers that update the display to `polygons`.
  visualization_msgs::MarkerArray update(const Polygons& polygons, const std::string& world_frame);

 private:
  ShownMarkers shown_;
};

}  // namespace situation_awareness

// SPDX-License-Identifier: BSD-3-Clause
#include "situation_awareness/ros/markers/map_markers.hpp"

#include <iterator>
#include <utility>
#include <vector>

#include "make_marker.hpp"
#include "situation_awareness/ros/markers/grid_markers.hpp"
#include "situation_awareness/ros/markers/object_markers.hpp"
#include "situation_awareness/ros/markers/polygon_markers.hpp"
#include "situation_awareness/ros/markers/splinegon_markers.hpp"

namespace situation_awareness {

visualization_msgs::MarkerArray MapMarkers::update(const Map& map, const std::string& world_frame) {
  const MapLayers layers = layers_of(map);
  std::vector<visualization_msgs::Marker> markers;
  const auto add = [&markers](std::vector<visualization_msgs::Marker> of_layer) {
    std::move(of_layer.begin(), of_layer.end(), std::back_inserter(markers));
  };
  add(markers_of(layers.boundaries, world_frame));
  add(markers_of(layers.polygons, world_frame));
  add(markers_of(layers.objects, world_frame));
  add(markers_of(layers.targets, world_frame));
  return shown_.update(make_header(world_frame, map.stamp_ns), std::move(markers));
}

}  // namespace situation_awareness

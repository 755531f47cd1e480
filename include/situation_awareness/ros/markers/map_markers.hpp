// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <string>

#include <visualization_msgs/MarkerArray.h>

#include "situation_awareness/map/map.hpp"
#include "situation_awareness/ros/markers/shown_markers.hpp"

namespace situation_awareness {

/// Markers of successive versions of the one map; deletes what is gone. Namespaces: those of markers_of() of objects,
/// polygons (walls are what is fixed, known what stands), boundaries and targets.
class MapMarkers {
 public:
  /// The markers that update the display to `map`.
  visualization_msgs::MarkerArray update(const Map& map, const std::string& world_frame);

 private:
  ShownMarkers shown_;
};

}  // namespace situation_awareness

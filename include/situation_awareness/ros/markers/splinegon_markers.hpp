// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <string>
#include <vector>

#include <visualization_msgs/MarkerArray.h>

#include "situation_awareness/geometry/pose2.hpp"
#include "situation_awareness/map/splinegons/splinegons.hpp"
#include "situation_awareness/polylines/polylines.hpp"
#include "situation_awareness/ros/markers/shown_markers.hpp"

namespace situation_awareness {

/// The markers that show it.
std::vector<visualization_msgs::Marker> markers_of(const Splinegons& splinegons, const std::string& world_frame);

/// Markers of successive maps of boundaries; deletes what is gone. Namespaces: closed, open (one marker each with all
/// such boundaries), envelope (the band that contains the boundary with 99 % at any place), vertices (main ones larger
/// than joints), id (beside the first vertex).
class SplinegonMarkers {
 public:
  /// The markers that update the display to `splinegons`.
  visualization_msgs::MarkerArray update(const Splinegons& splinegons, const std::string& world_frame);

 private:
  ShownMarkers shown_;
};

/// Markers of the polylines of successive scans, in the namespace local_polygon: what the scan says of the boundaries.
class LocalPolygonMarkers {
 public:
  /// `polylines` are placed in the map.
  visualization_msgs::MarkerArray update(const Polylines& polylines, const Pose2& T_world_map,
                                         const std::string& world_frame);

 private:
  ShownMarkers shown_;
};

}  // namespace situation_awareness

// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <string>
#include <vector>

#include <visualization_msgs/MarkerArray.h>

#include "situation_awareness/map/objects/objects.hpp"
#include "situation_awareness/ros/markers/shown_markers.hpp"

namespace situation_awareness {

/// The markers that show it.
std::vector<visualization_msgs::Marker> markers_of(const Objects& objects, const std::string& world_frame);

/// Markers of successive maps, each element in its own colour; deletes those of removed elements. Namespaces: object
/// (the ellipse or box), velocity (its motion in 1 s, if it moves), id (with the class, if it is known),
/// position_uncertainty (95 % ellipse of the centre).
class ObjectMarkers {
 public:
  /// The markers that update the display to `objects`.
  visualization_msgs::MarkerArray update(const Objects& objects, const std::string& world_frame);

 private:
  ShownMarkers shown_;
};

}  // namespace situation_awareness

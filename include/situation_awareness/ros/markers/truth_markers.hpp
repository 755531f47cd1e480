// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include <visualization_msgs/MarkerArray.h>

#include "situation_awareness/ros/markers/shown_markers.hpp"
#include "situation_awareness/sim/world.hpp"

namespace situation_awareness {

/// Markers of a world's objects in truth, dark, to be seen over a map of them; deletes those of objects that have gone.
/// Namespaces: object (the outline of the ellipse or polygon), velocity (the motion of the mean of its corners in 1 s,
/// if it moves), id (the name).
class TruthMarkers {
 public:
  /// The markers that update the display to those of `objects` that are there, at the height of a map in the world.
  /// `names` are those of all objects, as in `World::names()`.
  visualization_msgs::MarkerArray update(const std::vector<TrueObject>& objects, const std::vector<std::string>& names,
                                         double height_world_m, const std::string& world_frame, std::int64_t stamp_ns);

  /// The markers that update the display to those of `outlines` that are there: their outlines, without names.
  visualization_msgs::MarkerArray update(const std::vector<TrueOutline>& outlines, double height_world_m,
                                         const std::string& world_frame, std::int64_t stamp_ns);

 private:
  ShownMarkers shown_;
};

}  // namespace situation_awareness

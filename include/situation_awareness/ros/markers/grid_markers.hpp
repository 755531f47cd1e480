// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <string>
#include <vector>

#include <visualization_msgs/MarkerArray.h>

#include "situation_awareness/map/grid/grid.hpp"
#include "situation_awareness/ros/markers/shown_markers.hpp"

namespace situation_awareness {

/// The markers that show it.
std::vector<visualization_msgs::Marker> markers_of(const GridTargets& targets, const std::string& world_frame);

/// Markers of the targets of a semantic grid. Namespaces: target (a post over it), region (its 99 % region on the
/// ground), label (id and probability).
class GridMarkers {
 public:
  /// The markers that update the display to these targets.
  visualization_msgs::MarkerArray update(const GridTargets& targets, const std::string& world_frame);

 private:
  ShownMarkers shown_;
};

}  // namespace situation_awareness

// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <string>

#include <visualization_msgs/MarkerArray.h>

#include "situation_awareness/pipeline/localization_pipeline.hpp"
#include "situation_awareness/ros/markers/shown_markers.hpp"

namespace situation_awareness {

/// Markers of the reflectors after successive scans. Namespaces: reflector (as the map has them: green where it was
/// used, red where it is missing, orange where it was moved, else grey), number (its index in the file), moved (from
/// there to where it stands instead), sighting (white: used, yellow: it may be of several, violet: of none).
class ReflectorMarkers {
 public:
  /// The markers that update the display to the latest scan; sightings are shown while the pose is known.
  visualization_msgs::MarkerArray update(const LocalizationPipeline& pipeline, const ReflectorUpdate& update,
                                         const std::string& world_frame);

 private:
  ShownMarkers shown_;
};

}  // namespace situation_awareness

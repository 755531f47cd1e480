// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <string>

#include <visualization_msgs/MarkerArray.h>

#include "situation_awareness/path/safety_areas.hpp"

namespace situation_awareness {

/// The areas as outlines, namespaces `warning` (yellow) and `protective` (red), and what decides, namespaces `decides`
/// (a sphere) and `verdict` (a text).
visualization_msgs::MarkerArray safety_markers(const SafetyDecision& decision, double height_world_m,
                                               const std::string& world_frame);

}  // namespace situation_awareness

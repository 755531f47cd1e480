// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <string>
#include <vector>

#include <visualization_msgs/Marker.h>

#include "situation_awareness/map/objects/objects.hpp"

namespace situation_awareness {

/// The markers that show them, each element in its own colour. Namespaces: object (the ellipse or box), velocity (its
/// motion in 1 s, if it moves), id (with the class, if it is known), position_uncertainty (95 % ellipse of the centre).
std::vector<visualization_msgs::Marker> markers_of(const Objects& objects, const std::string& world_frame);

}  // namespace situation_awareness

// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <string>
#include <vector>

#include <visualization_msgs/Marker.h>

#include "situation_awareness/map/polygons/polygons.hpp"
#include "situation_awareness/ros/markers/colors.hpp"

namespace situation_awareness {

/// Wall dark grey, known blue, new green, doubted magenta: the areas before a vehicle are yellow and red.
Color color_of(ChainState state);

/// The markers that show them. Namespaces: wall, known, new, doubted (one marker each with all edges of such chains,
/// since a viewer draws few large markers much faster than many small ones), id (at the middle of each chain),
/// uncertainty (bars of 2 sigma to both sides across the boundary at each vertex).
std::vector<visualization_msgs::Marker> markers_of(const Polygons& polygons, const std::string& world_frame);

}  // namespace situation_awareness

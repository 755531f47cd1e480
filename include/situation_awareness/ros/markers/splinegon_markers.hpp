// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <string>
#include <vector>

#include <visualization_msgs/Marker.h>

#include "situation_awareness/map/splinegons/splinegons.hpp"

namespace situation_awareness {

/// The markers that show them. Namespaces: closed, open (one marker each with all such boundaries), envelope (the band
/// that contains the boundary with 99 % at any place), vertices (main ones larger than joints), id (beside the first
/// vertex).
std::vector<visualization_msgs::Marker> markers_of(const Splinegons& splinegons, const std::string& world_frame);

}  // namespace situation_awareness

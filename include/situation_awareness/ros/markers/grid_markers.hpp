// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <string>
#include <vector>

#include <visualization_msgs/Marker.h>

#include "situation_awareness/map/grid/grid.hpp"

namespace situation_awareness {

/// The markers that show them. Namespaces: target (a post over it), region (its 99 % region on the ground), label (id
/// and probability).
std::vector<visualization_msgs::Marker> markers_of(const GridTargets& targets, const std::string& world_frame);

}  // namespace situation_awareness

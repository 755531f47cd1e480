// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstdint>
#include <functional>
#include <string>

#include <visualization_msgs/MarkerArray.h>

#include "situation_awareness/path/scouting.hpp"

namespace situation_awareness {

/// Markers of a scouting mission, seen from `p_world_m`: namespaces region (its edge on the ground), way (to the next
/// stop), route (the stops after it), views (an arrow for each stop, those of close-ups in another colour) and budget
/// (what it does, and the time that is left). `ground_world_m`: as that of Scouting.
visualization_msgs::MarkerArray scout_markers(const Scouting& scouting, const ScoutingStep& step,
                                              const Eigen::Vector3d& p_world_m,
                                              const std::function<double(double, double)>& ground_world_m,
                                              std::int64_t stamp_ns, const std::string& world_frame);

}  // namespace situation_awareness

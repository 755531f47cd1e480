// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstdint>
#include <string>

#include <geometry_msgs/PoseStamped.h>
#include <situation_awareness/ScoutStatus.h>

#include "situation_awareness/path/scouting.hpp"

namespace situation_awareness {

ScoutStatus scouting_to_msg(const ScoutingStep& step, std::int64_t stamp_ns, const std::string& world_frame);

/// Where the vehicle is to go, level.
geometry_msgs::PoseStamped go_to_msg(const ScoutingStep& step, std::int64_t stamp_ns, const std::string& world_frame);

}  // namespace situation_awareness

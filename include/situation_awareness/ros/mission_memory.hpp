// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstdint>
#include <optional>
#include <string>

#include <ros/node_handle.h>
#include <Eigen/Core>

namespace situation_awareness {

/// Where and when a mission began, and whether it is over.
struct MissionBegin {
  Eigen::Vector3d p_world_m = Eigen::Vector3d::Zero();
  std::int64_t stamp_ns = 0;
  bool is_over = false;
};

/// As text of a parameter, and back; nothing if it is none.
std::string text_of(const MissionBegin& begin);
std::optional<MissionBegin> mission_begin_from(const std::string& text);

/// Keeps it as the parameter `resume` of the stage, for the manager that is started after a crash; without waiting for
/// a master that does not answer.
void remember(const ros::NodeHandle& private_node, const MissionBegin& begin);

}  // namespace situation_awareness

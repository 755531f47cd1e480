// SPDX-License-Identifier: BSD-3-Clause
#include "situation_awareness/ros/convert/scouting.hpp"

#include <cmath>

#include "situation_awareness/ros/convert/time.hpp"

namespace situation_awareness {

ScoutStatus scouting_to_msg(const ScoutingStep& step, std::int64_t stamp_ns, const std::string& world_frame) {
  static_assert(static_cast<int>(ScoutingState::kScout) == ScoutStatus::SCOUT);
  static_assert(static_cast<int>(ScoutingState::kHold) == ScoutStatus::HOLD);
  ScoutStatus msg;
  msg.header.stamp = to_ros_time(stamp_ns);
  msg.header.frame_id = world_frame;
  msg.state = static_cast<std::uint8_t>(step.state);
  msg.reason = step.reason;
  msg.target = step.target;
  msg.elapsed = step.elapsed_s;
  msg.left = step.left_s;
  msg.home_time = step.home_s;
  msg.targets = static_cast<std::uint32_t>(step.targets);
  msg.close_ups = static_cast<std::uint32_t>(step.close_ups);
  msg.given_up = static_cast<std::uint32_t>(step.given_up);
  msg.expected_left = step.expected_left;
  return msg;
}

geometry_msgs::PoseStamped go_to_msg(const ScoutingStep& step, std::int64_t stamp_ns, const std::string& world_frame) {
  geometry_msgs::PoseStamped msg;
  msg.header.stamp = to_ros_time(stamp_ns);
  msg.header.frame_id = world_frame;
  msg.pose.position.x = step.go_to_world_m.x();
  msg.pose.position.y = step.go_to_world_m.y();
  msg.pose.position.z = step.go_to_world_m.z();
  msg.pose.orientation.z = std::sin(0.5 * step.yaw_rad);
  msg.pose.orientation.w = std::cos(0.5 * step.yaw_rad);
  return msg;
}

}  // namespace situation_awareness

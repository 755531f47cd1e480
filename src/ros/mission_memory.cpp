// SPDX-License-Identifier: BSD-3-Clause
#include "situation_awareness/ros/mission_memory.hpp"

#include <iomanip>
#include <limits>
#include <sstream>

#include <ros/master.h>
#include <ros/this_node.h>

namespace situation_awareness {

std::string text_of(const MissionBegin& begin) {
  std::ostringstream text;
  text << std::setprecision(std::numeric_limits<double>::max_digits10) << "at " << begin.p_world_m.transpose() << " on "
       << begin.stamp_ns << (begin.is_over ? " over" : " runs");
  return text.str();
}

std::optional<MissionBegin> mission_begin_from(const std::string& text) {
  MissionBegin begin;
  std::istringstream stream(text);
  std::string at, on, state;
  stream >> at >> begin.p_world_m.x() >> begin.p_world_m.y() >> begin.p_world_m.z() >> on >> begin.stamp_ns >> state;
  if (!stream || at != "at" || on != "on" || (state != "over" && state != "runs")) return std::nullopt;
  begin.is_over = state == "over";
  return begin;
}

void remember(const ros::NodeHandle& private_node, const MissionBegin& begin) {
  XmlRpc::XmlRpcValue request, response, payload;
  request[0] = ros::this_node::getName();
  request[1] = private_node.resolveName("resume");
  request[2] = text_of(begin);
  const bool wait_for_master = false;
  ros::master::execute("setParam", request, response, payload, wait_for_master);
}

}  // namespace situation_awareness

// SPDX-License-Identifier: BSD-3-Clause
// Parts of markers, common to maps and truth. Private to ros/markers/.
#pragma once

#include <cstdint>
#include <string>

#include <geometry_msgs/Point.h>
#include <std_msgs/Header.h>
#include <visualization_msgs/Marker.h>
#include <Eigen/Core>

#include "situation_awareness/ros/convert/time.hpp"
#include "situation_awareness/ros/markers/colors.hpp"

namespace situation_awareness {

constexpr double kBodyHeight_m = 0.3;
constexpr Color kInkColor{0.1F, 0.1F, 0.1F};  ///< of texts, and of the truth

inline std_msgs::Header make_header(const std::string& frame, std::int64_t stamp_ns) {
  std_msgs::Header header;
  header.frame_id = frame;
  header.stamp = to_ros_time(stamp_ns);
  return header;
}

/// A marker of that type at the frame's origin; its id is the lower 31 bits of the object's.
inline visualization_msgs::Marker make_marker(const std_msgs::Header& header, const char* name, std::uint64_t id,
                                              std::int32_t type, const Color& color, float alpha) {
  visualization_msgs::Marker m;
  m.header = header;
  m.ns = name;
  m.id = static_cast<std::int32_t>(id & 0x7fffffffU);
  m.type = type;
  m.action = visualization_msgs::Marker::ADD;
  m.pose.orientation.w = 1.0;
  m.color.r = color.r;
  m.color.g = color.g;
  m.color.b = color.b;
  m.color.a = alpha;
  return m;
}

inline geometry_msgs::Point make_point(const Eigen::Vector2d& p_m, double z_m) {
  geometry_msgs::Point point;
  point.x = p_m.x();
  point.y = p_m.y();
  point.z = z_m;
  return point;
}

/// The motion in 1 s of an object at p_m.
inline visualization_msgs::Marker make_velocity(const std_msgs::Header& header, std::uint64_t id, const Color& color,
                                                const Eigen::Vector2d& p_m, const Eigen::Vector2d& velocity_m_s,
                                                double z_m, double shaft_diameter_m, double head_diameter_m) {
  auto m = make_marker(header, "velocity", id, visualization_msgs::Marker::ARROW, color, 1.0F);
  m.points = {make_point(p_m, z_m), make_point(p_m + velocity_m_s, z_m)};
  m.scale.x = shaft_diameter_m;
  m.scale.y = head_diameter_m;
  m.scale.z = 0.12;  // head length
  return m;
}

/// What an object is called, at p_m.
inline visualization_msgs::Marker make_label(const std_msgs::Header& header, std::uint64_t id, const std::string& text,
                                             const Eigen::Vector2d& p_m, double z_m) {
  auto m = make_marker(header, "id", id, visualization_msgs::Marker::TEXT_VIEW_FACING, kInkColor, 1.0F);
  m.pose.position = make_point(p_m, z_m);
  m.scale.z = 0.28;
  m.text = text;
  return m;
}

}  // namespace situation_awareness

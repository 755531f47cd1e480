// SPDX-License-Identifier: BSD-3-Clause
#include "situation_awareness/ros/markers/safety_markers.hpp"

#include <cstdio>
#include <vector>

#include "make_marker.hpp"

namespace situation_awareness {
namespace {

using visualization_msgs::Marker;

constexpr Color kWarningColor{0.98F, 0.8F, 0.05F};
constexpr Color kProtectiveColor{0.9F, 0.08F, 0.08F};
constexpr double kAreaLine_m = 0.03;

Marker area_outline(const std_msgs::Header& header, const char* name,
                    const std::vector<Eigen::Vector2d>& polygon_world_m, const Color& color, double height_m) {
  Marker m = make_marker(header, name, 0, Marker::LINE_STRIP, color, 1.0F);
  if (polygon_world_m.empty()) {
    m.action = Marker::DELETE;
    return m;
  }
  m.scale.x = kAreaLine_m;
  for (const Eigen::Vector2d& p : polygon_world_m) m.points.push_back(make_point(p, height_m));
  m.points.push_back(m.points.front());
  return m;
}

}  // namespace

visualization_msgs::MarkerArray safety_markers(const SafetyDecision& decision, double height_world_m,
                                               const std::string& world_frame) {
  const std_msgs::Header header = make_header(world_frame, decision.stamp_ns);
  visualization_msgs::MarkerArray markers;
  markers.markers.push_back(area_outline(header, "warning", decision.warning_world_m, kWarningColor, height_world_m));
  markers.markers.push_back(
      area_outline(header, "protective", decision.protective_world_m, kProtectiveColor, height_world_m));
  Marker decides =
      make_marker(header, "decides", 0, Marker::SPHERE,
                  decision.verdict == SafetyDecision::Verdict::kStop ? kProtectiveColor : kWarningColor, 1.0F);
  if (has_place(decision.kind)) {
    decides.pose.position = make_point(decision.place_world_m, height_world_m);
    decides.scale.x = decides.scale.y = decides.scale.z = 0.12;
  } else {
    decides.action = Marker::DELETE;
  }
  markers.markers.push_back(decides);

  Marker text = make_marker(header, "verdict", 0, Marker::TEXT_VIEW_FACING, kInkColor, 1.0F);
  if (decision.protective_world_m.empty()) {
    text.action = Marker::DELETE;
  } else {
    Eigen::Vector2d middle_m = Eigen::Vector2d::Zero();
    for (const Eigen::Vector2d& p : decision.protective_world_m) middle_m += p;
    middle_m /= static_cast<double>(decision.protective_world_m.size());
    text.pose.position = make_point(middle_m, height_world_m + 0.5);
    text.scale.z = 0.2;
    char speed[64];
    std::snprintf(speed, sizeof speed, "%s, %.2f m/s", name_of(decision.verdict), decision.allowed_speed_m_s);
    text.text = speed;
    if (decision.kind != SafetyDecision::Kind::kNone) text.text += std::string(": ") + name_of(decision.kind);
    if (decision.id != 0) text.text += ' ' + std::to_string(decision.id);
  }
  markers.markers.push_back(text);
  return markers;
}

}  // namespace situation_awareness

// SPDX-License-Identifier: BSD-3-Clause
#include "situation_awareness/ros/markers/object_markers.hpp"

#include <algorithm>
#include <cmath>

#include "situation_awareness/geometry/angles.hpp"
#include "situation_awareness/ros/convert/time.hpp"
#include "situation_awareness/ros/markers/colors.hpp"
#include "situation_awareness/ros/markers/object_shapes.hpp"

namespace situation_awareness {
namespace {

using visualization_msgs::Marker;

constexpr double kBodyHeight_m = 0.3;
constexpr Color kTruthColor{0.1F, 0.1F, 0.1F};

struct Style {
  MarkerStyle kind;
  std::string frame;
  ros::Time stamp;
  double height_m;  ///< of the middle of the bodies
};

Marker marker(const Style& style, const char* name, std::int32_t id, int type, const Color& color, float alpha) {
  Marker m;
  m.header.frame_id = style.frame;
  m.header.stamp = style.stamp;
  m.ns = name;
  m.id = id;
  m.type = type;
  m.action = Marker::ADD;
  m.pose.orientation.w = 1.0;
  m.color.r = color.r;
  m.color.g = color.g;
  m.color.b = color.b;
  m.color.a = alpha;
  return m;
}

geometry_msgs::Point point(const Eigen::Vector2d& p_m, double z_m) {
  geometry_msgs::Point result;
  result.x = p_m.x();
  result.y = p_m.y();
  result.z = z_m;
  return result;
}

void place(Marker& m, const Eigen::Vector2d& center_m, double z_m, double psi_rad) {
  m.pose.position = point(center_m, z_m);
  m.pose.orientation.z = std::sin(0.5 * psi_rad);
  m.pose.orientation.w = std::cos(0.5 * psi_rad);
}

Marker body(const Style& style, const Object& object, std::int32_t id) {
  const Ellipse& ellipse = object.ellipse_world;
  if (style.kind == MarkerStyle::kEstimate) {
    Marker m = marker(style, "object", id, Marker::CYLINDER, color_of(object.id), 0.6F);
    place(m, ellipse.center_m, style.height_m, ellipse.psi_rad);
    m.scale.x = 2.0 * ellipse.rx_m;
    m.scale.y = 2.0 * ellipse.ry_m;
    m.scale.z = kBodyHeight_m;
    return m;
  }
  Marker m = marker(style, "object", id, Marker::LINE_STRIP, kTruthColor, 1.0F);
  place(m, ellipse.center_m, style.height_m + 0.6 * kBodyHeight_m, ellipse.psi_rad);
  m.scale.x = 0.025;
  constexpr int kSides = 48;
  for (int i = 0; i <= kSides; ++i) {
    const double angle_rad = 2.0 * kPi * i / kSides;
    m.points.push_back(point({ellipse.rx_m * std::cos(angle_rad), ellipse.ry_m * std::sin(angle_rad)}, 0.0));
  }
  return m;
}

Marker velocity(const Style& style, const Object& object, std::int32_t id) {
  const bool truth = style.kind == MarkerStyle::kTruth;
  Marker m = marker(style, "velocity", id, Marker::ARROW, truth ? kTruthColor : color_of(object.id), 1.0F);
  const double z_m = style.height_m + kBodyHeight_m;
  const Eigen::Vector2d in_1s_m = object.ellipse_world.center_m + object.velocity_world_m_s;
  m.points = {point(object.ellipse_world.center_m, z_m), point(in_1s_m, z_m)};
  m.scale.x = truth ? 0.02 : 0.05;  // shaft diameter
  m.scale.y = truth ? 0.06 : 0.14;  // head diameter
  m.scale.z = 0.12;                 // head length
  return m;
}

Marker name(const Style& style, const Object& object, std::int32_t id, const std::string& text) {
  const bool truth = style.kind == MarkerStyle::kTruth;
  Marker m = marker(style, "id", id, Marker::TEXT_VIEW_FACING, kTruthColor, 1.0F);
  // The truth's label above its object and the id in it, so that both are readable.
  const Eigen::Vector2d offset_m(0.0, truth ? object.ellipse_world.rx_m + 0.2 : 0.0);
  m.pose.position = point(object.ellipse_world.center_m + offset_m, style.height_m + 2.0 * kBodyHeight_m);
  m.scale.z = 0.28;
  m.text = text;
  return m;
}

Marker uncertainty(const Style& style, const Object& object, std::int32_t id) {
  const Ellipse area = position_uncertainty(object);
  constexpr double kVisible_m = 0.005;
  Marker m = marker(style, "position_uncertainty", id, Marker::CYLINDER, kUncertaintyColor, 0.4F);
  place(m, area.center_m, style.height_m + 0.55 * kBodyHeight_m, area.psi_rad);
  m.scale.x = 2.0 * std::max(area.rx_m, kVisible_m);
  m.scale.y = 2.0 * std::max(area.ry_m, kVisible_m);
  m.scale.z = 0.005;
  return m;
}

}  // namespace

visualization_msgs::MarkerArray ObjectMarkers::update(const Objects& objects, const std::string& world_frame,
                                                      const std::vector<std::string>& labels) {
  const Style style{style_, world_frame, to_ros_time(objects.stamp_ns), objects.height_world_m};
  visualization_msgs::MarkerArray result;
  if (first_) {
    result.markers.emplace_back();
    result.markers.back().action = Marker::DELETEALL;
    result.markers.back().header.frame_id = world_frame;
    result.markers.back().header.stamp = style.stamp;
    result.markers.back().pose.orientation.w = 1.0;
    first_ = false;
  }
  std::set<Key> shown;
  const auto show = [&](Marker m) {
    shown.emplace(m.ns, m.id);
    result.markers.push_back(std::move(m));
  };
  for (std::size_t i = 0; i < objects.objects.size(); ++i) {
    const Object& object = objects.objects[i];
    const auto id = static_cast<std::int32_t>(object.id & 0x7fffffffU);
    show(body(style, object, id));
    if (moves(object)) show(velocity(style, object, id));
    show(name(style, object, id, i < labels.size() ? labels[i] : std::to_string(object.id)));
    if (style_ == MarkerStyle::kEstimate) show(uncertainty(style, object, id));
  }
  for (const Key& key : shown_) {
    if (shown.count(key) != 0) continue;
    Marker gone = marker(style, key.first.c_str(), key.second, Marker::CYLINDER, kTruthColor, 1.0F);
    gone.action = Marker::DELETE;
    result.markers.push_back(std::move(gone));
  }
  shown_ = std::move(shown);
  return result;
}

}  // namespace situation_awareness

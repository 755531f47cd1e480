// SPDX-License-Identifier: BSD-3-Clause
#include "situation_awareness/ros/markers/object_markers.hpp"

#include <algorithm>
#include <cmath>
#include <vector>

#include "make_marker.hpp"
#include "situation_awareness/ros/markers/object_shapes.hpp"

namespace situation_awareness {
namespace {

using visualization_msgs::Marker;

void place(Marker& m, const Eigen::Vector2d& center_m, double z_m, double psi_rad) {
  m.pose.position = make_point(center_m, z_m);
  m.pose.orientation.z = std::sin(0.5 * psi_rad);
  m.pose.orientation.w = std::cos(0.5 * psi_rad);
}

Marker body(const std_msgs::Header& header, const Object& object, double height_m) {
  const bool is_box = object.shape == Shape::kBox;
  const Ellipse& ellipse = object.ellipse_world;
  const Box& box = object.box_world;
  Marker m =
      make_marker(header, "object", object.id, is_box ? Marker::CUBE : Marker::CYLINDER, color_of(object.id), 0.6F);
  place(m, is_box ? box.center_m : ellipse.center_m, height_m, is_box ? box.psi_rad : ellipse.psi_rad);
  m.scale.x = 2.0 * (is_box ? box.half_length_m : ellipse.rx_m);
  m.scale.y = 2.0 * (is_box ? box.half_width_m : ellipse.ry_m);
  m.scale.z = kBodyHeight_m;
  return m;
}

Marker velocity(const std_msgs::Header& header, const Object& object, double height_m) {
  constexpr double kShaftDiameter_m = 0.05, kHeadDiameter_m = 0.14;
  return make_velocity(header, object.id, color_of(object.id), object.ellipse_world.center_m, object.velocity_world_m_s,
                       height_m + kBodyHeight_m, kShaftDiameter_m, kHeadDiameter_m);
}

Marker number(const std_msgs::Header& header, const Object& object, double height_m) {
  return make_label(header, object.id, std::to_string(object.id) + class_text(object), object.ellipse_world.center_m,
                    height_m + 2.0 * kBodyHeight_m);
}

Marker uncertainty(const std_msgs::Header& header, const Object& object, double height_m) {
  const Ellipse area = position_uncertainty(object);
  constexpr double kVisible_m = 0.005;
  Marker m = make_marker(header, "position_uncertainty", object.id, Marker::CYLINDER, kUncertaintyColor, 0.4F);
  place(m, area.center_m, height_m + 0.55 * kBodyHeight_m, area.psi_rad);
  m.scale.x = 2.0 * std::max(area.rx_m, kVisible_m);
  m.scale.y = 2.0 * std::max(area.ry_m, kVisible_m);
  m.scale.z = 0.005;
  return m;
}

}  // namespace

std::vector<visualization_msgs::Marker> markers_of(const Objects& objects, const std::string& world_frame) {
  const std_msgs::Header header = make_header(world_frame, objects.stamp_ns);
  std::vector<Marker> markers;
  for (const Object& object : objects.objects) {
    markers.push_back(body(header, object, objects.height_world_m));
    if (moves(object)) markers.push_back(velocity(header, object, objects.height_world_m));
    markers.push_back(number(header, object, objects.height_world_m));
    markers.push_back(uncertainty(header, object, objects.height_world_m));
  }
  return markers;
}

}  // namespace situation_awareness

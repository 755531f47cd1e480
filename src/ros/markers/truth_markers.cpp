// SPDX-License-Identifier: BSD-3-Clause
#include "situation_awareness/ros/markers/truth_markers.hpp"

#include <algorithm>
#include <utility>

#include "make_marker.hpp"
#include "situation_awareness/ros/markers/object_shapes.hpp"

namespace situation_awareness {
namespace {

using visualization_msgs::Marker;

Marker outline(const std_msgs::Header& header, std::uint64_t id, const std::vector<Eigen::Vector2d>& outline_world_m,
               double z_m) {
  Marker m = make_marker(header, "object", id, Marker::LINE_STRIP, kInkColor, 1.0F);
  m.scale.x = 0.025;
  for (const Eigen::Vector2d& p_world : outline_world_m) m.points.push_back(make_point(p_world, z_m));
  m.points.push_back(m.points.front());
  return m;
}

Marker velocity(const std_msgs::Header& header, std::uint64_t id, const Eigen::Vector2d& p_world_m,
                const Eigen::Vector2d& velocity_world_m_s, double z_m) {
  constexpr double kShaftDiameter_m = 0.02, kHeadDiameter_m = 0.06;
  return make_velocity(header, id, kInkColor, p_world_m, velocity_world_m_s, z_m, kShaftDiameter_m, kHeadDiameter_m);
}

}  // namespace

visualization_msgs::MarkerArray TruthMarkers::update(const std::vector<TrueObject>& objects,
                                                     const std::vector<std::string>& names, double height_world_m,
                                                     const std::string& world_frame, std::int64_t stamp_ns) {
  const std_msgs::Header header = make_header(world_frame, stamp_ns);
  std::vector<Marker> markers;
  for (const TrueObject& object : objects) {
    if (!object.is_there) continue;
    const std::vector<Eigen::Vector2d> outline_world_m = outline_of(object);
    Eigen::Vector2d center_world_m = Eigen::Vector2d::Zero();
    double top_m = outline_world_m.front().y();
    for (const Eigen::Vector2d& p_world : outline_world_m) {
      center_world_m += p_world / static_cast<double>(outline_world_m.size());
      top_m = std::max(top_m, p_world.y());
    }
    markers.push_back(outline(header, object.id, outline_world_m, height_world_m + 0.6 * kBodyHeight_m));

    // The body turns about its origin, which a mesh may have anywhere.
    const Eigen::Vector2d arm_m = center_world_m - object.T_world_object.translation_m;
    const Eigen::Vector2d velocity_m_s =
        object.velocity_world_m_s + object.angular_velocity_rad_s * Eigen::Vector2d(-arm_m.y(), arm_m.x());
    if (velocity_m_s.norm() > kMinDrawnSpeed_m_s) {
      markers.push_back(velocity(header, object.id, center_world_m, velocity_m_s, height_world_m + kBodyHeight_m));
    }
    // Above the object, and the map's id in it, so that both are readable.
    const Eigen::Vector2d p_name_m(center_world_m.x(), top_m + 0.2);
    markers.push_back(
        make_label(header, object.id, names[object.id - 1], p_name_m, height_world_m + 2.0 * kBodyHeight_m));
  }
  return shown_.update(header, std::move(markers));
}

visualization_msgs::MarkerArray TruthMarkers::update(const std::vector<TrueOutline>& outlines, double height_world_m,
                                                     const std::string& world_frame, std::int64_t stamp_ns) {
  const std_msgs::Header header = make_header(world_frame, stamp_ns);
  std::vector<Marker> markers;
  for (std::size_t i = 0; i < outlines.size(); ++i) {
    if (outlines[i].is_there) markers.push_back(outline(header, i + 1, outlines[i].points_world_m, height_world_m));
  }
  return shown_.update(header, std::move(markers));
}

}  // namespace situation_awareness

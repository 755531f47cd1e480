// SPDX-License-Identifier: BSD-3-Clause
#include "situation_awareness/ros/markers/scout_markers.hpp"

#include <algorithm>
#include <cmath>
#include <cstdio>

#include "make_marker.hpp"

namespace situation_awareness {
namespace {

using visualization_msgs::Marker;

constexpr Color kWayColor{0.1F, 0.5F, 0.95F};
constexpr Color kCloseUpColor{0.95F, 0.45F, 0.1F};
constexpr Color kEdgeColor{0.35F, 0.35F, 0.35F};
constexpr double kEdgeStep_m = 5.0;
constexpr double kArrow_m = 6.0;
constexpr double kTextAbove_m = 8.0;

}  // namespace

visualization_msgs::MarkerArray scout_markers(const Scouting& scouting, const ScoutingStep& step,
                                              const Eigen::Vector3d& p_world_m,
                                              const std::function<double(double, double)>& ground_world_m,
                                              std::int64_t stamp_ns, const std::string& world_frame) {
  const std_msgs::Header header = make_header(world_frame, stamp_ns);
  const ScoutRegion& region = scouting.params().region;
  const double level_m = p_world_m.z() - scouting.params().height_m;
  const auto ground_m = [&](const Eigen::Vector2d& p_m) {
    const double z_m = ground_world_m ? ground_world_m(p_m.x(), p_m.y()) : level_m;
    return std::isfinite(z_m) ? z_m : level_m;
  };
  visualization_msgs::MarkerArray array;
  Marker edge = make_marker(header, "region", 0, Marker::LINE_STRIP, kEdgeColor, 0.8F);
  edge.scale.x = 0.4;
  const Eigen::Vector2d corners_m[] = {{region.x_min_world_m, region.y_min_world_m},
                                       {region.x_max_world_m, region.y_min_world_m},
                                       {region.x_max_world_m, region.y_max_world_m},
                                       {region.x_min_world_m, region.y_max_world_m}};
  for (int i = 0; i < 4; ++i) {
    const Eigen::Vector2d along_m = corners_m[(i + 1) % 4] - corners_m[i];
    const int steps = std::max(1, static_cast<int>(std::min(along_m.norm() / kEdgeStep_m, 500.0)));
    for (int k = i == 0 ? 0 : 1; k <= steps; ++k) {
      const Eigen::Vector2d at_m = corners_m[i] + along_m * k / steps;
      edge.points.push_back(make_point(at_m, ground_m(at_m) + 0.3));
    }
  }
  array.markers.push_back(edge);
  Marker way = make_marker(header, "way", 0, Marker::LINE_STRIP, kWayColor, 1.0F);
  way.scale.x = 0.6;
  way.points.push_back(make_point(p_world_m.head<2>(), p_world_m.z()));
  for (const Eigen::Vector2d& corner_m : scouting.way()) {
    way.points.push_back(make_point(corner_m, step.go_to_world_m.z()));
  }
  Marker route = make_marker(header, "route", 0, Marker::LINE_STRIP, kWayColor, 0.5F);
  route.scale.x = 0.25;
  Marker views = make_marker(header, "views", 0, Marker::LINE_LIST, kWayColor, 1.0F);
  views.scale.x = 0.35;
  for (const ScoutStop& stop : scouting.route()) {
    const double z_m = ground_m(stop.p_world_m) + stop.height_m;
    route.points.push_back(make_point(stop.p_world_m, z_m));
    const Color& color = stop.target != 0 ? kCloseUpColor : kWayColor;
    std_msgs::ColorRGBA rgba;
    rgba.r = color.r;
    rgba.g = color.g;
    rgba.b = color.b;
    rgba.a = 1.0F;
    views.points.push_back(make_point(stop.p_world_m, z_m));
    views.points.push_back(
        make_point(stop.p_world_m + kArrow_m * Eigen::Vector2d(std::cos(stop.yaw_rad), std::sin(stop.yaw_rad)), z_m));
    views.colors.insert(views.colors.end(), 2, rgba);
  }
  for (Marker* line : {&way, &route, &views}) {
    if (line->points.size() < 2) line->action = Marker::DELETE;
    array.markers.push_back(*line);
  }
  Marker budget = make_marker(header, "budget", 0, Marker::TEXT_VIEW_FACING, kInkColor, 1.0F);
  budget.pose.position = make_point(p_world_m.head<2>(), p_world_m.z() + kTextAbove_m);
  budget.scale.z = 5.0;
  char text[120];
  std::snprintf(text, sizeof text, "%s  %.0f s left, home in %.0f s\n%zu targets, %zu close-ups", name_of(step.state),
                step.left_s, step.home_s, step.targets, step.close_ups);
  budget.text = text;
  array.markers.push_back(budget);
  return array;
}

}  // namespace situation_awareness

// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <array>
#include <cmath>
#include <cstddef>
#include <cstdint>

#include <costmap_converter/ObstacleArrayMsg.h>
#include <geometry_msgs/Point32.h>
#include <geometry_msgs/Pose2D.h>

#include "situation_awareness/MappedObjectArray.h"
#include "situation_awareness/geometry/angles.hpp"

namespace situation_awareness {

constexpr int kOutlineCorners = 16;          ///< of the polygon around an ellipse: at most 2 % longer than its radii
constexpr double kMaxCircleExcess_m = 0.05;  ///< rounder ellipses become circles, which are cheaper for planners

/// The map for teb_local_planner: the corners of a box; of anything else a point with a radius where the circle around
/// the ellipse is hardly larger, or a polygon around it; ids, orientations, and velocities with covariance in the frame
/// of the map.
inline costmap_converter::ObstacleArrayMsg obstacle_array_from_map(const MappedObjectArray& map) {
  costmap_converter::ObstacleArrayMsg result;
  result.header = map.header;
  for (const MappedObject& element : map.objects) {
    costmap_converter::ObstacleMsg obstacle;
    obstacle.header = map.header;
    obstacle.id = static_cast<std::int64_t>(element.id);
    obstacle.orientation = element.pose.orientation;
    obstacle.velocities.twist = element.twist;
    const std::array<std::size_t, 3> from{2, 3, 5};  // vx, vy, wz in MappedObject
    const std::array<std::size_t, 3> to{0, 1, 5};    // and in TwistWithCovariance
    for (std::size_t i = 0; i < from.size(); ++i) {
      for (std::size_t j = 0; j < from.size(); ++j) {
        obstacle.velocities.covariance[6 * to[i] + to[j]] = element.covariance[8 * from[i] + from[j]];
      }
    }
    const bool is_box = element.shape == MappedObject::BOX;
    geometry_msgs::Pose2D own = element.box;  // frame of the box or the ellipse
    if (!is_box) {
      own.x = element.pose.position.x;
      own.y = element.pose.position.y;
      own.theta = 2.0 * std::atan2(element.pose.orientation.z, element.pose.orientation.w);
    }
    const auto add_point = [&](double x_m, double y_m) {  // in that frame
      geometry_msgs::Point32 point;
      point.x = static_cast<float>(own.x + std::cos(own.theta) * x_m - std::sin(own.theta) * y_m);
      point.y = static_cast<float>(own.y + std::sin(own.theta) * x_m + std::cos(own.theta) * y_m);
      point.z = static_cast<float>(element.pose.position.z);
      obstacle.polygon.points.push_back(point);
    };
    if (is_box) {
      const double x_m = 0.5 * element.box_length, y_m = 0.5 * element.box_width;
      add_point(x_m, y_m);
      add_point(-x_m, y_m);
      add_point(-x_m, -y_m);
      add_point(x_m, -y_m);
    } else if (element.rx - element.ry <= kMaxCircleExcess_m) {
      obstacle.radius = element.rx;
      add_point(0.0, 0.0);
    } else {
      const double outwards = 1.0 / std::cos(kPi / kOutlineCorners);  // so that the sides touch the ellipse
      for (int i = 0; i < kOutlineCorners; ++i) {
        const double angle_rad = 2.0 * kPi * i / kOutlineCorners;
        add_point(outwards * element.rx * std::cos(angle_rad), outwards * element.ry * std::sin(angle_rad));
      }
    }
    result.obstacles.push_back(obstacle);
  }
  return result;
}

}  // namespace situation_awareness

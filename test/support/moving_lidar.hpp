// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <algorithm>
#include <cmath>
#include <limits>
#include <vector>

#include <Eigen/Geometry>

#include "situation_awareness/geometry/angles.hpp"
#include "situation_awareness/geometry/ellipse.hpp"
#include "situation_awareness/scan/scan.hpp"

namespace situation_awareness {

/// A lidar that moves at constant velocity during its scan of a static world of vertical objects, for tests: every beam
/// is intersected analytically from the pose at its own time.
struct MovingLidar {
  struct Wall {  ///< all points with normal . p = offset_m, endless
    Eigen::Vector2d normal;
    double offset_m;
  };
  std::vector<Ellipse> ellipses_world;
  std::vector<Wall> walls_world;

  Eigen::Isometry3d T_world_lidar = Eigen::Isometry3d::Identity();
  Eigen::Isometry3d T_world_lidar_end = Eigen::Isometry3d::Identity();
  double angle_min_rad = radians(-135.0);
  double angle_increment_rad = radians(0.25);
  int beams = 1081;
  double time_increment_s = 19e-3 / 1080.0;

  Eigen::Isometry3d T_world_lidar_at(int beam) const {
    const double part = static_cast<double>(beam) / (beams - 1);
    const Eigen::Quaterniond from(T_world_lidar.linear());
    const Eigen::Quaterniond to(T_world_lidar_end.linear());
    Eigen::Isometry3d T = Eigen::Isometry3d::Identity();
    T.linear() = from.slerp(part, to).toRotationMatrix();
    T.translation() = (1.0 - part) * T_world_lidar.translation() + part * T_world_lidar_end.translation();
    return T;
  }

  /// Where each beam ends in the world, seen from above; NaN without a hit.
  std::vector<Eigen::Vector2d> hits_world_m() const {
    std::vector<Eigen::Vector2d> hits;
    for (int i = 0; i < beams; ++i) {
      const Eigen::Isometry3d T = T_world_lidar_at(i);
      const Eigen::Vector2d origin = T.translation().head<2>();
      const Eigen::Vector2d along = (T.linear() * ray_lidar(i)).head<2>().normalized();
      double nearest_m = std::numeric_limits<double>::infinity();
      for (const Ellipse& ellipse : ellipses_world) {
        if (const auto hit = intersect_ray(ellipse, origin, along)) nearest_m = std::min(nearest_m, *hit);
      }
      for (const Wall& wall : walls_world) {
        const double range_m = (wall.offset_m - wall.normal.dot(origin)) / wall.normal.dot(along);
        if (range_m > 0.0) nearest_m = std::min(nearest_m, range_m);
      }
      const Eigen::Vector2d hit = origin + nearest_m * along;
      hits.push_back(hit.allFinite() ? hit : Eigen::Vector2d(std::nan(""), std::nan("")));
    }
    return hits;
  }

  Scan scan() const {
    Scan result;
    result.angle_min_rad = angle_min_rad;
    result.angle_increment_rad = angle_increment_rad;
    result.time_increment_s = time_increment_s;
    const std::vector<Eigen::Vector2d> hits = hits_world_m();
    for (int i = 0; i < beams; ++i) {
      const Eigen::Vector2d hit = hits[static_cast<std::size_t>(i)];
      if (!hit.allFinite()) {
        result.beams.push_back({std::numeric_limits<float>::infinity(), BeamState::kFree});
        continue;
      }
      const Eigen::Isometry3d T = T_world_lidar_at(i);
      const double horizontal = (T.linear() * ray_lidar(i)).head<2>().norm();  // of a metre along the beam
      const double range_m = (hit - T.translation().head<2>()).norm() / horizontal;
      result.beams.push_back({static_cast<float>(range_m), BeamState::kHit});
    }
    return result;
  }

 private:
  Eigen::Vector3d ray_lidar(int beam) const {
    const double angle_rad = angle_min_rad + beam * angle_increment_rad;
    return {std::cos(angle_rad), std::sin(angle_rad), 0.0};
  }
};

}  // namespace situation_awareness

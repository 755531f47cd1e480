// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cmath>
#include <cstdint>
#include <functional>
#include <vector>

#include <Eigen/Geometry>

#include "situation_awareness/common/random.hpp"
#include "situation_awareness/common/time.hpp"
#include "situation_awareness/geometry/angles.hpp"
#include "situation_awareness/geometry/ellipse.hpp"
#include "situation_awareness/geometry/pose2.hpp"
#include "situation_awareness/points/horizontal_projection.hpp"
#include "situation_awareness/points/points.hpp"
#include "support/level_scene.hpp"

namespace situation_awareness {

/// A robot that drives in a room of 10 m x 8 m with four round posts, for tests of what is estimated from scans and
/// poses. All is exact up to the noise of the ranges.
class RoomDrive {
 public:
  /// Where the robot is at a time in s.
  using Path = std::function<Pose2(double)>;

  explicit RoomDrive(Path path, std::uint64_t seed = 1) : path_(std::move(path)), random_(seed) {}

  /// Turns to and fro while it drives a figure of eight: velocity and turn rate change all the time.
  static Pose2 lively(double t_s) {
    return {{2.0 * std::sin(0.5 * t_s), 1.2 * std::sin(1.0 * t_s + 0.3)}, 0.9 * std::sin(0.8 * t_s) + 0.1 * t_s};
  }

  /// What a scan at this time sees, at the pose that is given for it.
  Points points(double time_s, const Pose2& pose, double sigma_m = 0.01) {
    LevelScene scene;
    scene.angle_min_rad = -kPi;
    scene.angle_increment_rad = radians(1.0);
    scene.beams = 360;
    const Pose2 T_lidar_world = inverse(path_(time_s));
    const auto seen = [&](double x, double y) { return Eigen::Vector2d(T_lidar_world * Eigen::Vector2d(x, y)); };
    const std::vector<Eigen::Vector2d> corners = {seen(-5, -4), seen(5, -4), seen(5, 4), seen(-5, 4)};
    for (std::size_t i = 0; i < 4; ++i) scene.walls.push_back({corners[i], corners[(i + 1) % 4]});
    for (const Eigen::Vector2d& post : {seen(-3.5, 2.5), seen(3.6, -2.6), seen(-4, -2), seen(3, 3)}) {
      scene.ellipses.push_back({post, 0.0, 0.2, 0.2});
    }
    for (const auto& [from, to] : moving_walls_world ? moving_walls_world(time_s) : std::vector<WallEnds>()) {
      scene.walls.push_back({seen(from.x(), from.y()), seen(to.x(), to.y())});
    }
    Scan scan = scene.scan(&random_, sigma_m);
    scan.stamp_ns = nanoseconds(kStart_s + time_s);
    Eigen::Isometry3d T = Eigen::Isometry3d::Identity();
    T.linear() = Eigen::AngleAxisd(pose.yaw_rad, Eigen::Vector3d::UnitZ()).toRotationMatrix();
    T.translation().head<2>() = pose.translation_m;
    return project_horizontally(scan, T);
  }

  Pose2 at(double time_s) const { return path_(time_s); }
  Random& random() { return random_; }

  using WallEnds = std::pair<Eigen::Vector2d, Eigen::Vector2d>;
  std::function<std::vector<WallEnds>(double)> moving_walls_world;

 private:
  static constexpr double kStart_s = 1000.0;

  Path path_;
  Random random_;
};

}  // namespace situation_awareness

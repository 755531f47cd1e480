// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <vector>

#include <Eigen/Geometry>

#include "situation_awareness/common/random.hpp"
#include "situation_awareness/geometry/angles.hpp"
#include "situation_awareness/geometry/box.hpp"
#include "situation_awareness/points/horizontal_projection.hpp"
#include "situation_awareness/polylines/polyline_extraction.hpp"
#include "situation_awareness/segments/segmentation.hpp"
#include "support/level_scene.hpp"

namespace situation_awareness {

/// Polylines of scans in a room with boxes, of 6 m x 4 m about the origin by default, from a place that moves.
class RoomPolylines {
 public:
  static constexpr std::int64_t kPeriod_ns = 40'000'000;

  explicit RoomPolylines(std::uint64_t seed, std::int64_t stamp_ns = 1'000'000'000'000,
                         const Box& walls = {{0.0, 0.0}, 0.0, 3.0, 2.0})
      : random_(seed), stamp_ns_(stamp_ns) {
    add_box(walls);
  }

  void add_box(const Box& box) {
    const std::array<Eigen::Vector2d, 4> at = corners(box);
    for (std::size_t i = 0; i < at.size(); ++i) walls_.push_back({at[i], at[(i + 1) % at.size()]});
  }

  void remove_box() { walls_.resize(walls_.size() - 4); }

  /// From now on of so many beams, half a degree apart, to the left of an azimuth.
  void look(double from_rad, int beams) {
    from_rad_ = from_rad;
    beams_ = beams;
  }

  void set_stamp(std::int64_t stamp_ns) { stamp_ns_ = stamp_ns; }
  /// Sets the period of the scans from the next one on. How fast the place moves stays.
  void set_period(std::int64_t period_ns) { period_ns_ = period_ns; }
  std::int64_t stamp_ns() const { return stamp_ns_; }

  /// Of the next scan.
  Polylines next() {
    const double t_s = 1e-9 * static_cast<double>(time_ns_);
    time_ns_ += period_ns_;
    const Pose2 T_world_level{{0.3 + 0.1 * t_s, 0.2 - 0.05 * t_s}, 0.1 * t_s};
    LevelScene scene;
    scene.angle_min_rad = from_rad_;
    scene.beams = beams_;
    scene.angle_increment_rad = 2.0 * kPi / 720;
    const Pose2 T_level_world = inverse(T_world_level);
    for (const LevelScene::Wall& wall : walls_) {
      scene.walls.push_back({T_level_world * wall.from, T_level_world * wall.to});
    }
    Scan scan = scene.scan(&random_, 0.01);
    scan.stamp_ns = stamp_ns_;
    Points points = project_horizontally(scan, Eigen::Isometry3d::Identity());
    points.T_world_level = T_world_level;
    points.height_world_m = 0.25;
    stamp_ns_ += period_ns_;
    return extract_polylines(segment(points, {}), {});
  }

  /// Polylines of so many scans.
  std::vector<Polylines> next(int scans) {
    std::vector<Polylines> result;
    for (int i = 0; i < scans; ++i) result.push_back(next());
    return result;
  }

 private:
  Random random_;
  std::int64_t stamp_ns_;
  std::vector<LevelScene::Wall> walls_;
  double from_rad_ = -kPi;
  int beams_ = 720;
  std::int64_t period_ns_ = kPeriod_ns, time_ns_ = 0;  ///< time since the first scan, without pauses
};

}  // namespace situation_awareness

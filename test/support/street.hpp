// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <array>
#include <cmath>
#include <cstddef>
#include <cstdint>

#include <Eigen/Geometry>

#include "situation_awareness/common/random.hpp"
#include "situation_awareness/geometry/angles.hpp"
#include "situation_awareness/geometry/box.hpp"
#include "situation_awareness/geometry/pose2.hpp"
#include "situation_awareness/points/horizontal_projection.hpp"
#include "situation_awareness/points/points.hpp"
#include "support/level_scene.hpp"

namespace situation_awareness {

/// Scans of a drive along the x axis through a straight street without end, with houses and lamp posts on both sides:
/// 541 beams of 30 m over 270 degrees, at 4 Hz and 5 m/s.
class StreetDrive {
 public:
  static constexpr std::int64_t kPeriod_ns = 250'000'000;
  static constexpr double kSpeed_m_s = 5.0;

  explicit StreetDrive(std::uint64_t seed) : random_(seed) {}

  double travelled_m() const { return x_m_; }
  /// Drives the other way from now on.
  void turn_round() { speed_m_s_ = -speed_m_s_; }

  /// Of the next scan.
  Points next() {
    const Pose2 T_world_level{{x_m_, 0.0}, 0.0};
    LevelScene scene;
    scene.angle_increment_rad = radians(0.5);
    scene.beams = 541;
    const double reach_m = scene.max_range_m + kHouseEvery_m;
    const auto first = [&](double every_m) { return std::ceil((x_m_ - reach_m) / every_m); };
    for (double k = first(kHouseEvery_m); k * kHouseEvery_m < x_m_ + reach_m; ++k) {
      for (const double side : {-1.0, 1.0}) {
        const Box house{{k * kHouseEvery_m - x_m_, side * 11.0}, 0.0, 5.0, 4.0};
        const std::array<Eigen::Vector2d, 4> at_m = corners(house);
        for (std::size_t i = 0; i < at_m.size(); ++i) scene.walls.push_back({at_m[i], at_m[(i + 1) % at_m.size()]});
      }
    }
    for (double k = first(kLampEvery_m); k * kLampEvery_m < x_m_ + reach_m; ++k) {
      for (const double side : {-1.0, 1.0}) {
        scene.ellipses.push_back({{k * kLampEvery_m - x_m_, side * 4.5}, 0.0, 0.08, 0.08});
      }
    }
    Scan scan = scene.scan(&random_, 0.01);
    scan.stamp_ns = stamp_ns_;
    Points points = project_horizontally(scan, Eigen::Isometry3d::Identity());
    points.T_world_level = T_world_level;
    stamp_ns_ += kPeriod_ns;
    x_m_ += speed_m_s_ * 1e-9 * static_cast<double>(kPeriod_ns);
    return points;
  }

 private:
  static constexpr double kHouseEvery_m = 14.0, kLampEvery_m = 25.0;

  Random random_;
  std::int64_t stamp_ns_ = 1'000'000'000'000;
  double x_m_ = 0.0, speed_m_s_ = kSpeed_m_s;
};

}  // namespace situation_awareness

// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <algorithm>
#include <cmath>
#include <limits>
#include <optional>
#include <vector>

#include "situation_awareness/common/random.hpp"
#include "situation_awareness/geometry/angles.hpp"
#include "situation_awareness/geometry/ellipse.hpp"
#include "situation_awareness/scan/scan.hpp"

namespace situation_awareness {

/// Where the ray from the origin along the unit vector `u` meets the ellipse. Most rays pass far from it, and without
/// intersecting these, tests of scans take a fraction of the time under sanitizers.
inline std::optional<double> range_along(const Ellipse& ellipse, const Eigen::Vector2d& u) {
  const double aside_m = std::abs(u.x() * ellipse.center_m.y() - u.y() * ellipse.center_m.x());
  if (aside_m > 1.001 * std::max(ellipse.rx_m, ellipse.ry_m)) return std::nullopt;
  return intersect_ray(ellipse, Eigen::Vector2d::Zero(), u);
}

/// A level scanner at the origin among ellipses and straight walls, for tests: rays are intersected analytically.
struct LevelScene {
  struct Wall {
    Eigen::Vector2d from;
    Eigen::Vector2d to;
  };
  std::vector<Ellipse> ellipses;
  std::vector<Wall> walls;

  double angle_min_rad = radians(-135.0);
  double angle_increment_rad = radians(0.25);
  int beams = 1081;
  double max_range_m = 30.0;

  /// Noiseless unless `random` is given.
  Scan scan(Random* random = nullptr, double sigma_m = 0.01) const {
    Scan result;
    result.angle_min_rad = angle_min_rad;
    result.angle_increment_rad = angle_increment_rad;
    for (int i = 0; i < beams; ++i) {
      const double angle_rad = angle_min_rad + i * angle_increment_rad;
      const Eigen::Vector2d u(std::cos(angle_rad), std::sin(angle_rad));
      double range_m = std::numeric_limits<double>::infinity();
      for (const Ellipse& ellipse : ellipses) {
        const auto hit = range_along(ellipse, u);
        if (hit && *hit < range_m) range_m = *hit;
      }
      for (const Wall& wall : walls) {
        Eigen::Matrix2d A;
        A << u, wall.from - wall.to;
        if (std::abs(A.determinant()) < 1e-12) continue;
        const Eigen::Vector2d s = A.inverse() * wall.from;
        if (s.x() > 0.0 && s.y() >= 0.0 && s.y() <= 1.0 && s.x() < range_m) range_m = s.x();
      }
      if (range_m > max_range_m) {
        result.beams.push_back({static_cast<float>(max_range_m), BeamState::kFree});
        continue;
      }
      if (random != nullptr) range_m += sigma_m * random->normal();
      result.beams.push_back({static_cast<float>(range_m), BeamState::kHit});
    }
    return result;
  }
};

}  // namespace situation_awareness

// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cmath>
#include <cstdint>
#include <vector>

#include "situation_awareness/common/random.hpp"
#include "situation_awareness/geometry/angles.hpp"
#include "situation_awareness/geometry/biarc.hpp"
#include "situation_awareness/path/obstacles.hpp"
#include "support/features.hpp"

namespace situation_awareness {

/// r(t) of the outlines of large obstacles, in m: an ellipse, a peanut, a kidney with a pocket, three lobes, a box.
enum class TowerShape { kEllipse, kPeanut, kKidney, kLobes, kBox };

/// Its outline, counter-clockwise around the origin.
inline std::vector<Eigen::Vector2d> tower(TowerShape shape, int count = 180) {
  std::vector<Eigen::Vector2d> outline;
  if (shape == TowerShape::kBox) return {{6.0, -3.5}, {6.0, 3.5}, {-6.0, 3.5}, {-6.0, -3.5}};
  for (int i = 0; i < count; ++i) {
    const double t = 2.0 * kPi * i / count;
    const Eigen::Vector2d u(std::cos(t), std::sin(t));
    switch (shape) {
      case TowerShape::kEllipse:
        outline.emplace_back(10.0 * u.x(), 6.0 * u.y());
        break;
      case TowerShape::kPeanut:
        outline.push_back((7.0 + 3.0 * std::cos(2.0 * t)) * u);
        break;
      case TowerShape::kKidney:
        outline.push_back((8.0 - 3.0 * std::exp(-2.0 * (1.0 - u.x()))) * u);
        break;
      default:
        outline.push_back((7.5 + 2.0 * std::cos(3.0 * t)) * u);
        break;
    }
  }
  return outline;
}

inline std::vector<Eigen::Vector2d> placed(const Pose2& T, std::vector<Eigen::Vector2d> outline) {
  for (Eigen::Vector2d& p : outline) p = T * p;
  return outline;
}

/// A splinegon of biarcs through places of an outline; corners where it has few.
inline Splinegon splinegon_of(const std::vector<Eigen::Vector2d>& outline, std::uint64_t id, double sigma_m,
                              bool closed = true) {
  Splinegon boundary;
  boundary.id = id;
  boundary.closed = closed;
  const std::size_t n = outline.size();
  const bool corners = n < 8;
  const std::size_t every = corners ? 1 : n / 18;
  const auto tangent = [&](std::size_t i) {
    const Eigen::Vector2d d = outline[(i + 1) % n] - outline[(i + n - 1) % n];
    return std::atan2(d.y(), d.x());
  };
  for (std::size_t i = 0; i + every <= n; i += every) {
    const Eigen::Vector2d a = outline[i], b = outline[(i + every) % n];
    if (corners) {
      boundary.vertices.push_back({a, 0.0, sigma_m, true});
      boundary.vertices.push_back({0.5 * (a + b), 0.0, sigma_m, false});
    } else {
      const Biarc biarc = equal_chord_biarc({a, tangent(i)}, {b, tangent((i + every) % n)});
      boundary.vertices.push_back({a, std::tan(0.25 * biarc.sweep0_rad), sigma_m, false});
      boundary.vertices.push_back({biarc.joint.translation_m, std::tan(0.25 * biarc.sweep1_rad), sigma_m, false});
    }
  }
  if (!closed) {
    boundary.vertices.resize(boundary.vertices.size() / 4 * 2 + 1);
    boundary.vertices.back().bulge = 0.0;
  }
  return boundary;
}

/// A map of these boundaries.
inline Map map_of(const std::vector<Splinegon>& boundaries, std::int64_t stamp_ns) {
  Map map;
  map.stamp_ns = stamp_ns;
  for (const Splinegon& boundary : boundaries) map.features.push_back(feature_of(boundary));
  return map;
}

}  // namespace situation_awareness

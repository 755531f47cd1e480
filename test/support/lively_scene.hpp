// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <vector>

#include "situation_awareness/common/random.hpp"
#include "situation_awareness/common/time.hpp"
#include "situation_awareness/detections/detections.hpp"
#include "situation_awareness/geometry/angles.hpp"
#include "situation_awareness/points/horizontal_projection.hpp"
#include "support/level_scene.hpp"
#include "support/random_gaussian.hpp"

namespace situation_awareness {

constexpr double kLivelyPeriod_s = 0.05;

/// Detections of a flying and turning scanner among objects of all kinds: they stand, with equal or different shapes,
/// walk with swinging arms, appear and disappear, occlude each other, and are sometimes missed. From `start_ns` on.
inline std::vector<Detections> lively_scene(int scans, std::int64_t start_ns, std::uint64_t seed) {
  constexpr double kSeen_m = 0.02;  // standard deviation of the detections
  Random random(seed);
  std::vector<Detections> result;
  for (int i = 0; i < scans; ++i) {
    const double t = i * kLivelyPeriod_s;
    std::vector<Ellipse> things = {{{3.0, 0.0}, 0.4, 0.3, 0.2}, {{5.0, 0.3}, 0.0, 0.25, 0.25}};
    for (int k = 0; k < 5; ++k) things.push_back({{2.0 + k, -3.5}, 0.0, 0.1, 0.1});  // poles, all alike
    const double y_m = -2.5 + 0.9 * std::fmod(t, 6.0);
    const double swing_m = 0.2 * std::sin(5.0 * t);
    things.push_back({{4.0, y_m}, 0.0, 0.22, 0.14});
    things.push_back({{4.33, y_m + swing_m}, 0.0, 0.06, 0.05});
    things.push_back({{3.67, y_m - swing_m}, 0.0, 0.06, 0.05});
    if (std::fmod(t, 4.0) < 2.5) things.push_back({{2.0, 2.0 + 0.8 * std::fmod(t, 4.0)}, 0.5, 0.3, 0.15});
    if (t > 5.0) things.push_back({{1.5, -1.5}, 0.0, 0.2, 0.2});

    Detections detections;
    detections.stamp_ns = start_ns + nanoseconds(t);
    detections.T_world_level = {{0.3 * std::sin(0.5 * t), 0.2 * t / (1.0 + 0.1 * t)}, 0.3 * std::sin(t)};
    detections.height_world_m = 0.8;
    LevelScene scene;
    scene.beams = 361;
    scene.angle_increment_rad = radians(0.75);
    for (const Ellipse& thing : things) scene.ellipses.push_back(inverse(detections.T_world_level) * thing);
    for (std::size_t k = 0; k < things.size(); ++k) {
      if (random.uniform() < 0.15) continue;
      Vector5d smooth = smooth_parameters(scene.ellipses[k]) + kSeen_m * normal_vector<5>(random);
      smooth(2) = std::max(smooth(2), smooth.tail<2>().norm() + 0.01);
      Detection detection;
      detection.ellipse_level = canonical(ellipse_from_smooth_parameters(smooth));
      detection.covariance = random_covariance<Matrix5d>(random, 0.5 * kSeen_m);
      detection.hidden_end = random.uniform() < 0.1;
      detection.time_offset_s = 0.0001 * static_cast<double>(k);
      detection.beams = 20;
      detections.detections.push_back(detection);
    }
    detections.free_space = free_space(project_horizontally(scene.scan(), Eigen::Isometry3d::Identity()));
    result.push_back(detections);
  }
  return result;
}

}  // namespace situation_awareness

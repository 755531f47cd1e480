// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstdint>
#include <vector>

#include <Eigen/Core>

#include "situation_awareness/geometry/pose2.hpp"
#include "situation_awareness/scan/scan.hpp"

namespace situation_awareness {

/// One beam in the level frame: origin at the lidar, z up, x the lidar's x axis turned into the horizontal plane.
struct Point {
  double azimuth_rad = 0.0;  ///< in the level frame, growing along Points::points, not wrapped
  double range_m = 0.0;      ///< horizontal distance where the state is kHit or kOutside, else 0
  Eigen::Vector2d p_level_m = Eigen::Vector2d::Zero();
  int beam = 0;  ///< index in the scan
  BeamState state = BeamState::kInvalid;
};

/// A scan in the horizontal plane: one point per beam, by growing azimuth whatever the direction of rotation or the
/// mounting of the scanner.
struct Points {
  std::int64_t stamp_ns = 0;
  Pose2 T_world_level;
  double height_world_m = 0.0;  ///< of the level plane
  double resolution_rad = 0.0;  ///< mean azimuth between neighbouring beams
  bool full_circle = false;     ///< the last beam is a neighbour of the first
  std::vector<Point> points;
};

}  // namespace situation_awareness

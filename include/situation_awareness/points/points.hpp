// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstdint>
#include <vector>

#include <Eigen/Core>

#include "situation_awareness/geometry/pose2.hpp"
#include "situation_awareness/scan/scan.hpp"

namespace situation_awareness {

/// One beam in the level frame: origin at the lidar when it took the first beam of the scan, z up, x the lidar's x axis
/// turned into the horizontal plane.
struct Point {
  double azimuth_rad = 0.0;  ///< of the hit, else of the beam; growing along Points::points, not wrapped
  double range_m = 0.0;      ///< horizontal: of the hit where the state is kHit or kOutside, reach where kFree, else 0
  Eigen::Vector2d p_level_m = Eigen::Vector2d::Zero();
  int beam = 0;  ///< index in the scan
  BeamState state = BeamState::kInvalid;
  float intensity = kNoIntensity;  ///< of its beam, in the sensor's own units
};

/// A scan in the horizontal plane: one point per beam, by growing azimuth whatever the direction of rotation or the
/// mounting of the scanner. Where the lidar moved while it scanned, azimuths may stay equal, and beams are left out
/// that it took beyond a full circle (docs/math/points.md, "Motion").
struct Points {
  std::int64_t stamp_ns = 0;
  Pose2 T_world_level;
  double height_world_m = 0.0;    ///< of the level plane
  double resolution_rad = 0.0;    ///< mean azimuth between neighbouring beams
  double time_increment_s = 0.0;  ///< from beam to beam, 0: all at one instant
  bool full_circle = false;       ///< the last beam is a neighbour of the first
  std::vector<Point> points;
};

/// How far the beams of a scan went before they met something, in the level frame by growing azimuth: what lies nearer
/// on them is free. Empty: nothing is known.
struct FreeSpace {
  std::vector<float> azimuth_rad;  ///< not wrapped
  std::vector<float> range_m;      ///< the sensor's reach where nothing was met, 0 where nothing is known
  bool full_circle = false;        ///< the last beam is a neighbour of the first
};

/// One value per point. A beam that met something of no interest is clear up to it as well.
/// `memory`: as for limit_range.
FreeSpace free_space(const Points& points, FreeSpace memory = {});

}  // namespace situation_awareness

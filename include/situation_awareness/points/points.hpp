// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstdint>
#include <vector>

#include <Eigen/Core>

#include "situation_awareness/geometry/pose2.hpp"
#include "situation_awareness/scan/scan.hpp"

namespace situation_awareness {

/// One beam in the level frame: origin at the lidar at the stamp (first beam), z up, x the lidar's x axis rotated into
/// the horizontal plane.
struct Point {
  double azimuth_rad = 0.0;  ///< of the hit, else of the beam; non-decreasing along Points::points, not wrapped
  double range_m = 0.0;      ///< horizontal: of the hit if kHit or kOutside, range_max if kFree, else 0
  Eigen::Vector2d p_level_m = Eigen::Vector2d::Zero();
  int beam = 0;  ///< index in the scan
  BeamState state = BeamState::kInvalid;
  float intensity = kNoIntensity;  ///< of its beam, in the sensor's own units
};

/// A scan in the horizontal plane: one point per beam, by increasing azimuth for any direction of rotation and mounting
/// of the scanner. Beams beyond a full circle are left out. Where the lidar moved during the scan, azimuths may be
/// equal (docs/math/points.md, "Motion").
struct Points {
  std::int64_t stamp_ns = 0;
  Pose2 T_world_level;
  double height_world_m = 0.0;    ///< of the level plane
  double resolution_rad = 0.0;    ///< mean azimuth between neighbouring beams
  double time_increment_s = 0.0;  ///< from beam to beam, 0: all at the stamp
  bool full_circle = false;       ///< the last beam is a neighbour of the first
  std::vector<Point> points;
};

/// Free space of a scan in the level frame: the range of each beam, by increasing azimuth; everything nearer is free.
/// Empty: unknown.
struct FreeSpace {
  std::vector<float> azimuth_rad;  ///< not wrapped
  std::vector<float> range_m;      ///< range_max where there was no return, 0 where unknown
  bool full_circle = false;        ///< the last beam is a neighbour of the first
};

/// One value per point. Free space ends also at hits outside the volume of interest. `memory`: as for limit_range.
FreeSpace free_space(const Points& points, FreeSpace memory = {});

}  // namespace situation_awareness

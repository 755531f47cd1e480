// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <vector>

#include <Eigen/Geometry>

#include "situation_awareness/cloud/cloud.hpp"
#include "situation_awareness/common/params.hpp"
#include "situation_awareness/geometry/angles.hpp"
#include "situation_awareness/sim/intensity.hpp"
#include "situation_awareness/sim/ray_scanner.hpp"
#include "situation_awareness/sim/scanner_errors.hpp"
#include "situation_awareness/sim/truth.hpp"

namespace situation_awareness {

/// A 3D scanner of several lasers that spin about its z axis; the defaults are those of a Velodyne VLP-16 at 20 Hz,
/// with the range of the 2D scanner. With other angles it simulates a depth camera.
struct SimulatedRingScannerParams {
  int rings = 16;
  double elevation_min_rad = radians(-15.0);
  double elevation_max_rad = radians(15.0);
  int columns = 900;
  double azimuth_min_rad = -kPi;
  double azimuth_increment_rad = 2.0 * kPi / 900.0;
  double rate_hz = 20.0;
  double sweep_s = 0.0499;
  double range_min_m = 0.1;
  double range_max_m = 30.0;
  double range_sigma_m = 0.01;
  SimulatedIntensityParams intensity;
  ScannerErrors errors;

  template <class Self, class Visit>
  static void fields(Self& self, Visit&& visit) {
    visit("rings", self.rings, Bounds{1, 256}, "", "lasers, one above the other");
    visit("elevation_min_rad", self.elevation_min_rad, Bounds{-1.57, 1.57}, "rad", "of the lowest ring, ring 0");
    visit("elevation_max_rad", self.elevation_max_rad, Bounds{-1.57, 1.57}, "rad",
          "of the highest ring; those between are evenly spaced");
    visit("columns", self.columns, Bounds{2, 10000}, "", "points of one ring in one revolution");
    visit("azimuth_min_rad", self.azimuth_min_rad, Bounds{-2.0 * kPi, 2.0 * kPi}, "rad", "of the first column");
    visit("azimuth_increment_rad", self.azimuth_increment_rad, Bounds{-kPi, kPi}, "rad",
          "from column to column, negative for a scanner that turns clockwise; at most one revolution in all");
    visit_ray_scanner_fields(self, visit);
  }

  /// Throws std::invalid_argument naming field and bound.
  void validate() const;
};

/// The measurements of a ring scanner, with the true hits.
struct RingScannerSample {
  Cloud cloud;                                                           ///< structured: a row for each ring
  Eigen::Isometry3d T_world_sensor = Eigen::Isometry3d::Identity();      ///< at the stamp
  Eigen::Isometry3d T_world_sensor_end = Eigen::Isometry3d::Identity();  ///< at the last column's time
  std::vector<TrueHit> hits;                                             ///< of each point
};

extern template class RayScanner<SimulatedRingScannerParams>;

/// A 3D scanner on the robot of a world. The rays of one column have one time; that of the first column is the stamp.
class SimulatedRingScanner : public RayScanner<SimulatedRingScannerParams> {
 public:
  using RayScanner::RayScanner;

  RingScannerSample next();
};

}  // namespace situation_awareness

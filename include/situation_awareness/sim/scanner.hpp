// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <vector>

#include <Eigen/Geometry>

#include "situation_awareness/common/params.hpp"
#include "situation_awareness/geometry/angles.hpp"
#include "situation_awareness/scan/scan.hpp"
#include "situation_awareness/sim/intensity.hpp"
#include "situation_awareness/sim/ray_scanner.hpp"
#include "situation_awareness/sim/truth.hpp"

namespace situation_awareness {

/// A 2D scanner; the defaults are the Hokuyo UTM-30LX of the papers.
struct SimulatedScannerParams {
  int beams = 1081;
  double angle_min_rad = radians(-135.0);
  double angle_increment_rad = radians(0.25);
  double rate_hz = 20.0;
  double sweep_s = 0.0;
  double range_min_m = 0.1;
  double range_max_m = 30.0;
  double range_sigma_m = 0.01;
  SimulatedIntensityParams intensity;

  template <class Self, class Visit>
  static void fields(Self& self, Visit&& visit) {
    visit("beams", self.beams, Bounds{2, 100000}, "", "beams of one scan");
    visit("angle_min_rad", self.angle_min_rad, Bounds{-2.0 * kPi, 2.0 * kPi}, "rad", "azimuth of the first beam");
    visit("angle_increment_rad", self.angle_increment_rad, Bounds{-kPi, kPi}, "rad",
          "azimuth from beam to beam, negative for a scanner that turns clockwise");
    visit_ray_scanner_fields(self, visit);
  }

  /// Throws std::invalid_argument naming field and bound.
  void validate() const;
};

/// The measurements of a scanner, with the true hits.
struct ScannerSample {
  Scan scan;
  Eigen::Isometry3d T_world_lidar = Eigen::Isometry3d::Identity();      ///< at the stamp
  Eigen::Isometry3d T_world_lidar_end = Eigen::Isometry3d::Identity();  ///< at the last beam's time
  std::vector<TrueHit> hits;                                            ///< of each beam
};

extern template class RayScanner<SimulatedScannerParams>;

/// A 2D scanner on the robot of a world; the stamp is the time of the first beam.
class SimulatedScanner : public RayScanner<SimulatedScannerParams> {
 public:
  using RayScanner::RayScanner;

  ScannerSample next();
};

}  // namespace situation_awareness

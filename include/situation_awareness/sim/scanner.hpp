// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <vector>

#include <Eigen/Geometry>

#include "situation_awareness/common/params.hpp"
#include "situation_awareness/geometry/angles.hpp"
#include "situation_awareness/scan/scan.hpp"
#include "situation_awareness/sim/intensity.hpp"
#include "situation_awareness/sim/ray_scanner.hpp"
#include "situation_awareness/sim/scanner_errors.hpp"
#include "situation_awareness/sim/truth.hpp"

namespace situation_awareness {

/// A 2D scanner; the defaults are the Hokuyo UTM-30LX of the papers, with white noise as its only error.
struct SimulatedScannerParams {
  int beams = 1081;
  double angle_min_rad = radians(-135.0);
  double angle_increment_rad = radians(0.25);
  double rate_hz = 20.0;
  double sweep_s = 0.0;
  double range_min_m = 0.1;
  double range_max_m = 30.0;
  double range_sigma_m = 0.01;
  int sweep_against_order = 0;
  double time_increment_scale = 1.0;
  double stamp_error_s = 0.0;
  SimulatedIntensityParams intensity;
  ScannerErrors errors;

  template <class Self, class Visit>
  static void fields(Self& self, Visit&& visit) {
    visit("beams", self.beams, Bounds{2, 100000}, "", "beams of one scan");
    visit("angle_min_rad", self.angle_min_rad, Bounds{-2.0 * kPi, 2.0 * kPi}, "rad", "azimuth of the first beam");
    visit("angle_increment_rad", self.angle_increment_rad, Bounds{-kPi, kPi}, "rad",
          "azimuth from beam to beam, negative for a scanner that turns clockwise");
    visit("sweep_against_order", self.sweep_against_order, Bounds{0, 1}, "",
          "1: beams are measured from the last to the first, whatever the scan says of their times");
    visit("time_increment_scale", self.time_increment_scale, Bounds{0.0, 1000.0}, "",
          "the time from beam to beam that the scan says, over the true one");
    visit("stamp_error_s", self.stamp_error_s, Bounds{-1.0, 1.0}, "s",
          "the scan's stamp less the time of the beam that is measured first; positive: late");
    visit_ray_scanner_fields(self, visit);
  }

  /// Throws std::invalid_argument naming field and bound.
  void validate() const;
};

/// The measurements of a scanner, with the true hits. Poses are at the times that the scan says, as whoever receives it
/// looks them up.
struct ScannerSample {
  Scan scan;
  Eigen::Isometry3d T_world_lidar = Eigen::Isometry3d::Identity();      ///< at the stamp
  Eigen::Isometry3d T_world_lidar_end = Eigen::Isometry3d::Identity();  ///< at the last beam's time
  std::vector<TrueHit> hits;                                            ///< of each beam
};

extern template class RayScanner<SimulatedScannerParams>;

/// A 2D scanner on the robot of a world; the stamp is the time of the first beam, unless the params say otherwise.
class SimulatedScanner : public RayScanner<SimulatedScannerParams> {
 public:
  using RayScanner::RayScanner;

  ScannerSample next();
};

}  // namespace situation_awareness

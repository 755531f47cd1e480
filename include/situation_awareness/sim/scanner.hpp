// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstdint>
#include <memory>
#include <vector>

#include <Eigen/Geometry>

#include "situation_awareness/common/params.hpp"
#include "situation_awareness/geometry/angles.hpp"
#include "situation_awareness/scan/scan.hpp"
#include "situation_awareness/sim/intensity.hpp"
#include "situation_awareness/sim/truth.hpp"
#include "situation_awareness/sim/world.hpp"

namespace situation_awareness {

class RayCaster;

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
    visit("rate_hz", self.rate_hz, Bounds{0.1, 1000.0}, "Hz", "scans per second");
    visit(
        "sweep_s", self.sweep_s, Bounds{0.0, 1.0}, "s",
        "time from the first beam to the last, less than from scan to scan; 0: all at one instant (UTM-30LX: 0.01875)");
    visit("range_min_m", self.range_min_m, Bounds{0.001, 1000.0}, "m", "what is nearer is too close");
    visit("range_max_m", self.range_max_m, Bounds{0.001, 1000.0}, "m", "what is farther is not seen");
    visit("range_sigma_m", self.range_sigma_m, Bounds{0.0, 1.0}, "m", "standard deviation of the ranges, Gaussian");
    SimulatedIntensityParams::fields(self.intensity, visit);
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

/// A 2D scanner on the robot of a world.
///
/// The stamp is the time of the first beam. With a sweep time, each beam is cast from the robot's pose at the beam's
/// own time, with the objects' poses at that time; else nothing moves during a scan. True ranges decide whether a beam
/// is a hit, too close or free; noise is added to hits only and never moves them across the sensor's limits. Same seed,
/// same scans, bit for bit: each scan has its own seed.
class SimulatedScanner {
 public:
  /// `world` must outlive the scanner, which moves it. Throws std::invalid_argument for params.
  SimulatedScanner(World& world, const Eigen::Isometry3d& T_robot_lidar, const SimulatedScannerParams& params,
                   std::uint64_t seed);
  ~SimulatedScanner();
  SimulatedScanner(SimulatedScanner&&) noexcept;
  SimulatedScanner& operator=(SimulatedScanner&&) noexcept;

  const SimulatedScannerParams& params() const { return params_; }

  /// When the next scan begins; the first is at time 0.
  double next_time_s() const { return static_cast<double>(scans_) / params_.rate_hz; }

  ScannerSample next();

 private:
  SimulatedScannerParams params_;
  Eigen::Isometry3d T_robot_lidar_;
  std::uint64_t seed_;
  std::unique_ptr<RayCaster> rays_;
  std::uint64_t scans_ = 0;
};

}  // namespace situation_awareness

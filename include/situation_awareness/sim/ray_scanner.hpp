// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstdint>
#include <memory>
#include <stdexcept>
#include <string>

#include <Eigen/Geometry>

#include "situation_awareness/common/params.hpp"
#include "situation_awareness/common/random.hpp"
#include "situation_awareness/scan/scan.hpp"
#include "situation_awareness/sim/intensity.hpp"
#include "situation_awareness/sim/scanner_errors.hpp"
#include "situation_awareness/sim/truth.hpp"
#include "situation_awareness/sim/world.hpp"

namespace situation_awareness {

class RayCaster;

/// The common parameters of all scanners: rate, sweep, range, intensity and errors.
template <class Self, class Visit>
void visit_ray_scanner_fields(Self& self, Visit&& visit) {
  visit("rate_hz", self.rate_hz, Bounds{0.1, 1000.0}, "Hz", "scans per second");
  visit("sweep_s", self.sweep_s, Bounds{0.0, 1.0}, "s",
        "time from the first ray to the last, less than from scan to scan; 0: all at one instant (UTM-30LX: 0.01875)");
  visit("range_min_m", self.range_min_m, Bounds{0.001, 1000.0}, "m", "nearer objects are too close");
  visit("range_max_m", self.range_max_m, Bounds{0.001, 1000.0}, "m", "farther objects are not seen");
  visit("range_sigma_m", self.range_sigma_m, Bounds{0.0, 1.0}, "m", "standard deviation of the ranges, Gaussian");
  SimulatedIntensityParams::fields(self.intensity, visit);
  ScannerErrors::fields(self.errors, visit);
}

/// Checks the bounds of all fields, and those of the fields above against each other. Throws std::invalid_argument
/// naming field and bound; `section` is what its name begins with.
template <class Params>
void check_ray_scanner_params(const Params& params, const std::string& section) {
  check_bounds(params, section);
  if (!(params.range_max_m > params.range_min_m)) {
    throw std::invalid_argument(section + ".range_max_m must be above " + section + ".range_min_m");
  }
  if (!(params.range_max_m - params.range_min_m >= params.errors.range_quantum_m)) {
    throw std::invalid_argument(section + ".range_quantum_m must be at most " + section + ".range_max_m - " + section +
                                ".range_min_m");
  }
  if (!(params.sweep_s < 1.0 / params.rate_hz)) {
    throw std::invalid_argument(section + ".sweep_s must be below 1 / " + section + ".rate_hz");
  }
}

/// The measurement along one ray.
struct RayReturn {
  BeamState state = BeamState::kFree;  ///< kHit, kFree or kTooClose
  double range_m = 0.0;                ///< where it is a hit: with its errors, within the sensor's limits
  float intensity = kNoIntensity;      ///< where it is a hit and intensities are measured
  TrueHit truth;                       ///< where it is a hit; of a mixture of surfaces that of the brightest
};

/// Common part of the scanners on the robot of a world. Scans begin at multiples of 1 / rate_hz; each ray is cast from
/// the robot's pose at the ray's own time, with the objects' poses at that time. True ranges decide whether a ray is a
/// hit, too close or free, unless its return is dropped; errors of hits never move them across the sensor's limits.
/// Same seed, same scans, bit for bit: each scan has its own seed.
template <class Params>
class RayScanner {
 public:
  /// `world` must outlive the scanner, which moves it. Throws std::invalid_argument for params.
  RayScanner(World& world, const Eigen::Isometry3d& T_robot_sensor, const Params& params, std::uint64_t seed);
  ~RayScanner();
  RayScanner(RayScanner&&) noexcept;
  RayScanner& operator=(RayScanner&&) noexcept;

  const Params& params() const { return params_; }

  /// When the next scan begins; the first is at time 0.
  double next_time_s() const { return static_cast<double>(scans_) / params_.rate_hz; }

  /// Leaves the next scan out, as a scanner that is off; the others stay as they are.
  void skip() { ++scans_; }

 protected:
  /// A scan that is being taken.
  struct Sweep {
    double start_s;
    Random noise, intensity_noise, errors;
    Eigen::Isometry3d T_world_sensor;  ///< now
  };

  /// Begins the next scan; the sensor is where its first ray is cast.
  Sweep begin_sweep();

  /// Moves sensor and objects to where they are `time_s` after the first ray.
  void move_to(double time_s, Sweep& sweep);

  /// Where the sensor is at any time.
  Eigen::Isometry3d sensor_at(double time_s) const;

  /// One draw of each error that is on, whatever the ray meets. `ray_sensor` is a unit vector.
  RayReturn cast(const Eigen::Vector3d& ray_sensor, Sweep& sweep) const;

 private:
  Params params_;
  Eigen::Isometry3d T_robot_sensor_;
  std::uint64_t seed_;
  double least_power_ = 0.0;  // received from what has a return
  std::unique_ptr<RayCaster> rays_;
  std::uint64_t scans_ = 0;
};

}  // namespace situation_awareness

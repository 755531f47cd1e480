// SPDX-License-Identifier: BSD-3-Clause
#include "situation_awareness/sim/scanner.hpp"

#include <algorithm>
#include <cmath>
#include <stdexcept>
#include <string>

#include "ray_caster.hpp"
#include "seeds.hpp"
#include "situation_awareness/common/random.hpp"
#include "situation_awareness/common/time.hpp"

namespace situation_awareness {

void SimulatedScannerParams::validate() const {
  check_bounds(*this, "scanner");
  if (!(range_max_m > range_min_m)) {
    throw std::invalid_argument("scanner.range_max_m must be above scanner.range_min_m");
  }
  if (!(sweep_s < 1.0 / rate_hz)) throw std::invalid_argument("scanner.sweep_s must be below 1 / scanner.rate_hz");
  const std::string defect = scan_defect(static_cast<std::size_t>(beams), angle_min_rad, angle_increment_rad);
  if (!defect.empty()) throw std::invalid_argument("scanner.angle_increment_rad: " + defect);
}

SimulatedScanner::SimulatedScanner(World& world, const Eigen::Isometry3d& T_robot_lidar,
                                   const SimulatedScannerParams& params, std::uint64_t seed)
    : params_(params), T_robot_lidar_(T_robot_lidar), seed_(seed) {
  params.validate();
  rays_ = std::make_unique<RayCaster>(world);
}

SimulatedScanner::~SimulatedScanner() = default;
SimulatedScanner::SimulatedScanner(SimulatedScanner&&) noexcept = default;
SimulatedScanner& SimulatedScanner::operator=(SimulatedScanner&&) noexcept = default;

ScannerSample SimulatedScanner::next() {
  const double start_s = next_time_s();
  const auto min_range_m = static_cast<float>(params_.range_min_m);
  const auto max_range_m = static_cast<float>(params_.range_max_m);
  Random noise(seed_of_scan(seed_, scans_));
  Random intensity_noise(seed_of_scan(seed_ ^ kIntensityStream, scans_));
  ++scans_;

  ScannerSample sample;
  Scan& scan = sample.scan;
  scan.stamp_ns = nanoseconds(start_s);
  scan.angle_min_rad = params_.angle_min_rad;
  scan.angle_increment_rad = params_.angle_increment_rad;
  scan.time_increment_s = params_.sweep_s / (params_.beams - 1);
  scan.beams.resize(static_cast<std::size_t>(params_.beams));
  sample.hits.resize(scan.beams.size());
  sample.T_world_lidar_end = rays_->robot_at(start_s + params_.sweep_s).T_world_robot * T_robot_lidar_;
  sample.T_world_lidar = rays_->move_to(start_s) * T_robot_lidar_;
  Eigen::Isometry3d T_world_lidar = sample.T_world_lidar;
  for (int i = 0; i < params_.beams; ++i) {
    if (i > 0 && scan.time_increment_s > 0.0) {
      T_world_lidar = rays_->move_to(start_s + i * scan.time_increment_s) * T_robot_lidar_;
    }
    const double angle_rad = params_.angle_min_rad + i * params_.angle_increment_rad;
    const Eigen::Vector3d beam_world =
        T_world_lidar.linear() * Eigen::Vector3d(std::cos(angle_rad), std::sin(angle_rad), 0.0);
    const Ray ray = rays_->cast(T_world_lidar.translation(), beam_world);
    const double relative_error = params_.intensity.sigma * intensity_noise.normal();
    const double error_m = params_.range_sigma_m * noise.normal();  // one draw per beam, whatever it meets

    Beam& beam = scan.beams[static_cast<std::size_t>(i)];
    if (ray.geom < 0 || ray.range_m > params_.range_max_m) {
      beam = {max_range_m, BeamState::kFree};
    } else if (ray.range_m < params_.range_min_m) {
      beam.state = BeamState::kTooClose;
    } else {
      beam.state = BeamState::kHit;
      beam.range_m = std::clamp(static_cast<float>(ray.range_m + error_m), min_range_m, max_range_m);
      if (params_.intensity.gain > 0.0) {
        const double intensity = rays_->intensity(ray, T_world_lidar.translation(), beam_world, params_.intensity);
        beam.intensity = static_cast<float>(std::max(0.0, intensity * (1.0 + relative_error)));
      }
      if (ray.object >= 0) sample.hits[static_cast<std::size_t>(i)] = {ray.object, ray.range_m};
    }
  }
  return sample;
}

}  // namespace situation_awareness

// SPDX-License-Identifier: BSD-3-Clause
#include "situation_awareness/sim/scanner.hpp"

#include <cmath>
#include <stdexcept>
#include <string>

#include "situation_awareness/common/time.hpp"

namespace situation_awareness {

void SimulatedScannerParams::validate() const {
  check_ray_scanner_params(*this, "scanner");
  const std::string defect = scan_defect(static_cast<std::size_t>(beams), angle_min_rad, angle_increment_rad);
  if (!defect.empty()) throw std::invalid_argument("scanner.angle_increment_rad: " + defect);
}

ScannerSample SimulatedScanner::next() {
  Sweep sweep = begin_sweep();
  ScannerSample sample;
  Scan& scan = sample.scan;
  const double stamp_s = sweep.start_s + params().stamp_error_s;
  const double time_increment_s = params().sweep_s / (params().beams - 1);
  scan.stamp_ns = nanoseconds(stamp_s);
  scan.angle_min_rad = params().angle_min_rad;
  scan.angle_increment_rad = params().angle_increment_rad;
  scan.time_increment_s = params().time_increment_scale * time_increment_s;
  scan.beams.resize(static_cast<std::size_t>(params().beams));
  sample.hits.resize(scan.beams.size());
  sample.T_world_lidar = sensor_at(stamp_s);
  sample.T_world_lidar_end = sensor_at(stamp_s + params().time_increment_scale * params().sweep_s);
  for (int measured = 0; measured < params().beams; ++measured) {
    if (measured > 0 && time_increment_s > 0.0) move_to(measured * time_increment_s, sweep);
    const int i = params().sweep_against_order != 0 ? params().beams - 1 - measured : measured;
    const double angle_rad = params().angle_min_rad + i * params().angle_increment_rad;
    const RayReturn ray = cast({std::cos(angle_rad), std::sin(angle_rad), 0.0}, sweep);
    Beam& beam = scan.beams[static_cast<std::size_t>(i)];
    beam.state = ray.state;
    beam.intensity = ray.intensity;
    if (ray.state == BeamState::kHit) beam.range_m = static_cast<float>(ray.range_m);
    if (ray.state == BeamState::kFree) beam.range_m = static_cast<float>(params().range_max_m);
    sample.hits[static_cast<std::size_t>(i)] = ray.truth;
  }
  return sample;
}

}  // namespace situation_awareness

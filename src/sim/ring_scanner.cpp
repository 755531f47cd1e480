// SPDX-License-Identifier: BSD-3-Clause
#include "situation_awareness/sim/ring_scanner.hpp"

#include <cmath>
#include <stdexcept>

#include "situation_awareness/common/time.hpp"

namespace situation_awareness {

void SimulatedRingScannerParams::validate() const {
  check_ray_scanner_params(*this, "ring_scanner");
  const auto check = [](bool is_good, const char* sentence) {
    if (!is_good) throw std::invalid_argument(sentence);
  };
  check(rings == 1 || elevation_max_rad > elevation_min_rad,
        "ring_scanner.elevation_max_rad must be above ring_scanner.elevation_min_rad");
  check(azimuth_increment_rad != 0.0, "ring_scanner.azimuth_increment_rad must not be 0");
  check(columns * std::abs(azimuth_increment_rad) < 2.0 * kPi + 1e-6,
        "ring_scanner.columns * ring_scanner.azimuth_increment_rad must be at most one revolution");
}

RingScannerSample SimulatedRingScanner::next() {
  Sweep sweep = begin_sweep();
  RingScannerSample sample;
  Cloud& cloud = sample.cloud;
  cloud.stamp_ns = nanoseconds(sweep.start_s);
  cloud.rows = static_cast<std::size_t>(params().rings);
  cloud.columns = static_cast<std::size_t>(params().columns);
  cloud.points.resize(cloud.rows * cloud.columns);
  sample.hits.resize(cloud.points.size());
  sample.T_world_sensor = sweep.T_world_sensor;
  sample.T_world_sensor_end = sensor_at(sweep.start_s + params().sweep_s);
  const double time_increment_s = params().sweep_s / (params().columns - 1);
  const double elevation_increment_rad =
      params().rings > 1 ? (params().elevation_max_rad - params().elevation_min_rad) / (params().rings - 1) : 0.0;
  for (int column = 0; column < params().columns; ++column) {
    const double time_s = column * time_increment_s;
    if (column > 0 && time_increment_s > 0.0) move_to(time_s, sweep);
    const double azimuth_rad = params().azimuth_min_rad + column * params().azimuth_increment_rad;
    for (int ring = 0; ring < params().rings; ++ring) {
      const double elevation_rad = params().elevation_min_rad + ring * elevation_increment_rad;
      const Eigen::Vector3d ray_sensor(std::cos(elevation_rad) * std::cos(azimuth_rad),
                                       std::cos(elevation_rad) * std::sin(azimuth_rad), std::sin(elevation_rad));
      const RayReturn ray = cast(ray_sensor, sweep);
      const std::size_t place = static_cast<std::size_t>(ring) * cloud.columns + static_cast<std::size_t>(column);
      CloudPoint& point = cloud.points[place];
      point.ring = static_cast<std::uint16_t>(ring);
      point.time_s = static_cast<float>(time_s);
      if (ray.state != BeamState::kHit) continue;
      const Eigen::Vector3f p_sensor = (ray.range_m * ray_sensor).cast<float>();
      point.x_m = p_sensor.x();
      point.y_m = p_sensor.y();
      point.z_m = p_sensor.z();
      point.intensity = ray.intensity;
      sample.hits[place] = ray.truth;
    }
  }
  return sample;
}

}  // namespace situation_awareness

// SPDX-License-Identifier: BSD-3-Clause
#include "situation_awareness/sim/ring_scanner.hpp"

#include <algorithm>
#include <cmath>
#include <stdexcept>

#include "ray_caster.hpp"
#include "seeds.hpp"
#include "situation_awareness/common/random.hpp"
#include "situation_awareness/common/time.hpp"

namespace situation_awareness {

void SimulatedRingScannerParams::validate() const {
  check_bounds(*this, "ring_scanner");
  const auto check = [](bool is_good, const char* sentence) {
    if (!is_good) throw std::invalid_argument(sentence);
  };
  check(range_max_m > range_min_m, "ring_scanner.range_max_m must be above ring_scanner.range_min_m");
  check(sweep_s < 1.0 / rate_hz, "ring_scanner.sweep_s must be below 1 / ring_scanner.rate_hz");
  check(rings == 1 || elevation_max_rad > elevation_min_rad,
        "ring_scanner.elevation_max_rad must be above ring_scanner.elevation_min_rad");
  check(azimuth_increment_rad != 0.0, "ring_scanner.azimuth_increment_rad must not be 0");
  check(columns * std::abs(azimuth_increment_rad) < 2.0 * kPi + 1e-6,
        "ring_scanner.columns * ring_scanner.azimuth_increment_rad must be at most one revolution");
}

SimulatedRingScanner::SimulatedRingScanner(World& world, const Eigen::Isometry3d& T_robot_sensor,
                                           const SimulatedRingScannerParams& params, std::uint64_t seed)
    : params_(params), T_robot_sensor_(T_robot_sensor), seed_(seed) {
  params.validate();
  rays_ = std::make_unique<RayCaster>(world);
}

SimulatedRingScanner::~SimulatedRingScanner() = default;
SimulatedRingScanner::SimulatedRingScanner(SimulatedRingScanner&&) noexcept = default;
SimulatedRingScanner& SimulatedRingScanner::operator=(SimulatedRingScanner&&) noexcept = default;

RingScannerSample SimulatedRingScanner::next() {
  const double start_s = next_time_s();
  Random noise(seed_of_scan(seed_, scans_));
  Random intensity_noise(seed_of_scan(seed_ ^ kIntensityStream, scans_));
  ++scans_;

  RingScannerSample sample;
  Cloud& cloud = sample.cloud;
  cloud.stamp_ns = nanoseconds(start_s);
  cloud.rows = static_cast<std::size_t>(params_.rings);
  cloud.columns = static_cast<std::size_t>(params_.columns);
  cloud.points.resize(cloud.rows * cloud.columns);
  sample.hits.resize(cloud.points.size());
  const double time_increment_s = params_.sweep_s / (params_.columns - 1);
  const double elevation_increment_rad =
      params_.rings > 1 ? (params_.elevation_max_rad - params_.elevation_min_rad) / (params_.rings - 1) : 0.0;
  sample.T_world_sensor_end = rays_->robot_at(start_s + params_.sweep_s).T_world_robot * T_robot_sensor_;
  sample.T_world_sensor = rays_->move_to(start_s) * T_robot_sensor_;
  Eigen::Isometry3d T_world_sensor = sample.T_world_sensor;
  for (int column = 0; column < params_.columns; ++column) {
    const double time_s = column * time_increment_s;
    if (column > 0 && time_increment_s > 0.0) T_world_sensor = rays_->move_to(start_s + time_s) * T_robot_sensor_;
    const double azimuth_rad = params_.azimuth_min_rad + column * params_.azimuth_increment_rad;
    for (int ring = 0; ring < params_.rings; ++ring) {
      const double elevation_rad = params_.elevation_min_rad + ring * elevation_increment_rad;
      const Eigen::Vector3d ray_sensor(std::cos(elevation_rad) * std::cos(azimuth_rad),
                                       std::cos(elevation_rad) * std::sin(azimuth_rad), std::sin(elevation_rad));
      const Eigen::Vector3d ray_world = T_world_sensor.linear() * ray_sensor;
      const Ray ray = rays_->cast(T_world_sensor.translation(), ray_world);
      const double relative_error = params_.intensity.sigma * intensity_noise.normal();
      const double error_m = params_.range_sigma_m * noise.normal();  // one draw per ray, whatever it meets

      const std::size_t place = static_cast<std::size_t>(ring) * cloud.columns + static_cast<std::size_t>(column);
      CloudPoint& point = cloud.points[place];
      point.ring = static_cast<std::uint16_t>(ring);
      point.time_s = static_cast<float>(time_s);
      if (ray.geom < 0 || ray.range_m > params_.range_max_m || ray.range_m < params_.range_min_m) continue;
      const Eigen::Vector3f p_sensor =
          (std::clamp(ray.range_m + error_m, params_.range_min_m, params_.range_max_m) * ray_sensor).cast<float>();
      point.x_m = p_sensor.x();
      point.y_m = p_sensor.y();
      point.z_m = p_sensor.z();
      if (params_.intensity.gain > 0.0) {
        const double intensity = rays_->intensity(ray, T_world_sensor.translation(), ray_world, params_.intensity);
        point.intensity = static_cast<float>(std::max(0.0, intensity * (1.0 + relative_error)));
      }
      if (ray.object >= 0) sample.hits[place] = {ray.object, ray.range_m};
    }
  }
  return sample;
}

}  // namespace situation_awareness

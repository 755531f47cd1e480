// SPDX-License-Identifier: BSD-3-Clause
#include "situation_awareness/sim/ray_scanner.hpp"

#include <algorithm>

#include "ray_caster.hpp"
#include "seeds.hpp"
#include "situation_awareness/sim/ring_scanner.hpp"
#include "situation_awareness/sim/scanner.hpp"

namespace situation_awareness {

template <class Params>
RayScanner<Params>::RayScanner(World& world, const Eigen::Isometry3d& T_robot_sensor, const Params& params,
                               std::uint64_t seed)
    : params_(params), T_robot_sensor_(T_robot_sensor), seed_(seed) {
  params.validate();
  rays_ = std::make_unique<RayCaster>(world);
}

template <class Params>
RayScanner<Params>::~RayScanner() = default;
template <class Params>
RayScanner<Params>::RayScanner(RayScanner&&) noexcept = default;
template <class Params>
RayScanner<Params>& RayScanner<Params>::operator=(RayScanner&&) noexcept = default;

template <class Params>
typename RayScanner<Params>::Sweep RayScanner<Params>::begin_sweep() {
  const double start_s = next_time_s();
  Sweep sweep{start_s, Random(seed_of_scan(seed_, scans_)), Random(seed_of_scan(seed_ ^ kIntensityStream, scans_)),
              rays_->robot_at(start_s + params_.sweep_s).T_world_robot * T_robot_sensor_,
              rays_->move_to(start_s) * T_robot_sensor_};
  ++scans_;
  return sweep;
}

template <class Params>
void RayScanner<Params>::move_to(double time_s, Sweep& sweep) {
  sweep.T_world_sensor = rays_->move_to(sweep.start_s + time_s) * T_robot_sensor_;
}

template <class Params>
RayReturn RayScanner<Params>::cast(const Eigen::Vector3d& ray_sensor, Sweep& sweep) const {
  const Eigen::Vector3d origin_world = sweep.T_world_sensor.translation();
  const Eigen::Vector3d ray_world = sweep.T_world_sensor.linear() * ray_sensor;
  const Ray ray = rays_->cast(origin_world, ray_world);
  const double relative_error = params_.intensity.sigma * sweep.intensity_noise.normal();
  const double error_m = params_.range_sigma_m * sweep.noise.normal();

  RayReturn result;
  if (ray.geom < 0 || ray.range_m > params_.range_max_m) return result;
  if (ray.range_m < params_.range_min_m) {
    result.state = BeamState::kTooClose;
    return result;
  }
  result.state = BeamState::kHit;
  result.range_m = std::clamp(ray.range_m + error_m, params_.range_min_m, params_.range_max_m);
  if (params_.intensity.gain > 0.0) {
    const double intensity = rays_->intensity(ray, origin_world, ray_world, params_.intensity);
    result.intensity = static_cast<float>(std::max(0.0, intensity * (1.0 + relative_error)));
  }
  if (ray.object >= 0) result.truth = {ray.object, ray.range_m};
  return result;
}

template class RayScanner<SimulatedScannerParams>;
template class RayScanner<SimulatedRingScannerParams>;

}  // namespace situation_awareness

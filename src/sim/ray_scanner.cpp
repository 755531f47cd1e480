// SPDX-License-Identifier: BSD-3-Clause
#include "situation_awareness/sim/ray_scanner.hpp"

#include <algorithm>
#include <array>
#include <optional>

#include "ray_caster.hpp"
#include "seeds.hpp"
#include "situation_awareness/sim/ring_scanner.hpp"
#include "situation_awareness/sim/scanner.hpp"

namespace situation_awareness {
namespace {

/// The random numbers of a beam for the effects that are on.
struct ErrorDraws {
  ErrorDraws(const ScannerErrors& errors, Random& random) {
    if (errors.bearing_sigma_rad > 0.0) bearing = random.normal();
    if (errors.missing_fraction > 0.0) missing = random.uniform();
    if (errors.beam_has_width()) {
      edge_missing = random.uniform();
      edge_mixed = random.uniform();
    }
    if (errors.dark_range_m > 0.0 && errors.detection_sigma > 0.0) detection = random.normal();
  }

  double bearing = 0.0, detection = 0.0;                       // N(0, 1)
  double missing = 0.0, edge_missing = 0.0, edge_mixed = 0.0;  // uniform in [0, 1)
};

/// A ray in the world, with what it meets at any range.
struct CastRay {
  Eigen::Vector3d origin, direction;
  Ray ray;
};

CastRay cast_ray(const RayCaster& rays, const Eigen::Vector3d& origin, const Eigen::Vector3d& direction) {
  return {origin, direction, rays.cast(origin, direction)};
}

/// In the plane of the scan.
Eigen::Vector3d turned(const Eigen::Vector3d& ray_sensor, double angle_rad) {
  return Eigen::AngleAxisd(angle_rad, Eigen::Vector3d::UnitZ()) * ray_sensor;
}

/// The rays over the width of a beam.
std::array<CastRay, kRaysOfBeam> cast_beam(const RayCaster& rays, const Eigen::Isometry3d& T_world_sensor,
                                           const Eigen::Vector3d& axis_sensor, const ScannerErrors& errors) {
  const Eigen::Vector3d across_sensor = Eigen::Vector3d::UnitZ().cross(axis_sensor).normalized();
  std::array<CastRay, kRaysOfBeam> result;
  for (int i = 0; i < kRaysOfBeam; ++i) {
    const double offset_m = 0.5 * errors.beam_diameter_m * place_in_beam(i);
    const double angle_rad = 0.5 * errors.beam_divergence_rad * place_in_beam(i);
    result[static_cast<std::size_t>(i)] = cast_ray(rays, T_world_sensor * (offset_m * across_sensor),
                                                   T_world_sensor.linear() * turned(axis_sensor, angle_rad));
  }
  return result;
}

/// Without their powers.
BeamRays beam_rays(const std::array<CastRay, kRaysOfBeam>& across) {
  BeamRays rays;
  for (std::size_t i = 0; i < rays.size(); ++i) rays[i] = {across[i].ray.geom, across[i].ray.range_m, 0.0};
  return rays;
}

/// Adds the powers of the rays that meet something within range, and leaves out what others meet. Returns whether there
/// are any.
bool add_powers(const RayCaster& caster, const std::array<CastRay, kRaysOfBeam>& across,
                const SimulatedIntensityParams& intensity, double range_max_m, BeamRays& rays) {
  bool any = false;
  for (std::size_t i = 0; i < rays.size(); ++i) {
    if (rays[i].range_m > range_max_m) rays[i].surface = -1;
    if (rays[i].surface < 0) continue;
    any = true;
    rays[i].power = share_of_beam(static_cast<int>(i)) *
                    caster.received_power(across[i].ray, across[i].origin, across[i].direction, intensity);
  }
  return any;
}

}  // namespace

template <class Params>
RayScanner<Params>::RayScanner(World& world, const Eigen::Isometry3d& T_robot_sensor, const Params& params,
                               std::uint64_t seed)
    : params_(params), T_robot_sensor_(T_robot_sensor), seed_(seed) {
  params.validate();
  least_power_ = received_power(params.intensity, {kDarkReflectivity, 0.0, 0.0}, params.errors.dark_range_m, 1.0);
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
              Random(seed_of_scan(seed_ ^ kErrorStream, scans_)), rays_->move_to(start_s) * T_robot_sensor_};
  ++scans_;
  return sweep;
}

template <class Params>
void RayScanner<Params>::move_to(double time_s, Sweep& sweep) {
  sweep.T_world_sensor = rays_->move_to(sweep.start_s + time_s) * T_robot_sensor_;
}

template <class Params>
Eigen::Isometry3d RayScanner<Params>::sensor_at(double time_s) const {
  return rays_->robot_at(time_s).T_world_robot * T_robot_sensor_;
}

template <class Params>
RayReturn RayScanner<Params>::cast(const Eigen::Vector3d& ray_sensor, Sweep& sweep) const {
  const ScannerErrors& errors = params_.errors;
  const double relative_error = params_.intensity.sigma * sweep.intensity_noise.normal();
  const double range_draw = sweep.noise.normal();
  const ErrorDraws draws(errors, sweep.errors);

  const Eigen::Vector3d axis_sensor =
      errors.bearing_sigma_rad > 0.0 ? turned(ray_sensor, errors.bearing_sigma_rad * draws.bearing) : ray_sensor;
  CastRay hit = cast_ray(*rays_, sweep.T_world_sensor.translation(), sweep.T_world_sensor.linear() * axis_sensor);
  double range_m = hit.ray.range_m;
  std::optional<double> edge_power;
  if (errors.beam_has_width()) {
    const auto across = cast_beam(*rays_, sweep.T_world_sensor, axis_sensor, errors);
    BeamRays rays = beam_rays(across);
    if (is_at_depth_edge(rays, errors.edge_depth_m)) {
      const bool is_hit = add_powers(*rays_, across, params_.intensity, params_.range_max_m, rays);
      if (!is_hit || draws.edge_missing < errors.edge_missing_fraction) return {};
      const EdgeReturn edge = edge_return(rays, draws.edge_mixed < errors.edge_mixed_fraction);
      hit = across[static_cast<std::size_t>(edge.ray)];
      range_m = edge.range_m;
      edge_power = edge.power;
    }
  }

  RayReturn result;
  if (hit.ray.geom < 0 || range_m > params_.range_max_m) return result;
  if (range_m < params_.range_min_m) {
    result.state = BeamState::kTooClose;
    return result;
  }
  if (draws.missing < errors.missing_fraction) return result;
  if (errors.dark_range_m > 0.0) {
    const double power =
        edge_power ? *edge_power : rays_->received_power(hit.ray, hit.origin, hit.direction, params_.intensity);
    if (power * (1.0 + errors.detection_sigma * draws.detection) < least_power_) return result;
  }

  const double cos_incidence =
      errors.depends_on_incidence() ? rays_->cos_incidence(hit.ray, hit.origin, hit.direction) : 1.0;
  const double sigma_m = params_.range_sigma_m + range_sigma_growth(errors, range_m, cos_incidence);
  result.state = BeamState::kHit;
  result.range_m = quantised(range_m + range_bias(errors, range_m, cos_incidence) + sigma_m * range_draw,
                             errors.range_quantum_m, params_.range_min_m, params_.range_max_m);
  if (params_.intensity.gain > 0.0) {
    const double intensity = edge_power ? std::min(params_.intensity.max, params_.intensity.gain * *edge_power)
                                        : rays_->intensity(hit.ray, hit.origin, hit.direction, params_.intensity);
    result.intensity = static_cast<float>(std::max(0.0, intensity * (1.0 + relative_error)));
  }
  if (hit.ray.object >= 0) {
    result.truth = {hit.ray.object, hit.ray.range_m, rays_->on_body(hit.ray, hit.origin, hit.direction)};
  }
  return result;
}

template class RayScanner<SimulatedScannerParams>;
template class RayScanner<SimulatedRingScannerParams>;

}  // namespace situation_awareness

// SPDX-License-Identifier: BSD-3-Clause
#include "situation_awareness/sim/scanner_errors.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>

namespace situation_awareness {
namespace {

constexpr std::size_t kAxis = kRaysOfBeam / 2;

std::array<double, kRaysOfBeam> shares_of_beam() {
  std::array<double, kRaysOfBeam> shares{};
  double sum = 0.0;
  for (int ray = 0; ray < kRaysOfBeam; ++ray) {
    const double place = place_in_beam(ray);
    sum += shares[static_cast<std::size_t>(ray)] = std::sqrt(1.0 - place * place);
  }
  for (double& share : shares) share /= sum;
  return shares;
}

/// Light returned by one surface.
double power_of(const BeamRays& rays, int surface) {
  double power = 0.0;
  for (const BeamRay& ray : rays) power += ray.surface == surface ? ray.power : 0.0;
  return power;
}

std::size_t distance_from_axis(std::size_t ray) { return ray > kAxis ? ray - kAxis : kAxis - ray; }

}  // namespace

double range_bias(const ScannerErrors& errors, double range_m, double cos_incidence) {
  return errors.range_bias_m + range_m * (errors.range_bias_slope + range_m * errors.range_bias_square_1_m) +
         errors.grazing_bias_m * (1.0 - cos_incidence);
}

double range_sigma_growth(const ScannerErrors& errors, double range_m, double cos_incidence) {
  return errors.range_sigma_slope * range_m + errors.grazing_sigma_m * (1.0 - cos_incidence);
}

double quantised(double range_m, double quantum_m, double low_m, double high_m) {
  if (quantum_m == 0.0) return std::clamp(range_m, low_m, high_m);
  const double lowest = std::ceil(low_m / quantum_m), highest = std::floor(high_m / quantum_m);
  return quantum_m * std::min(std::max(std::round(range_m / quantum_m), lowest), highest);
}

double share_of_beam(int ray) {
  static const std::array<double, kRaysOfBeam> shares = shares_of_beam();
  return shares[static_cast<std::size_t>(ray)];
}

bool is_at_depth_edge(const BeamRays& rays, double edge_depth_m) {
  for (std::size_t i = 1; i < rays.size(); ++i) {
    const BeamRay &a = rays[i - 1], &b = rays[i];
    if (a.surface == b.surface) continue;
    if (a.surface < 0 || b.surface < 0 || std::abs(a.range_m - b.range_m) > edge_depth_m) return true;
  }
  return false;
}

EdgeReturn edge_return(const BeamRays& rays, bool is_mixed) {
  EdgeReturn result;
  double most = -1.0;
  std::size_t nearest = rays.size();
  for (std::size_t i = 0; i < rays.size(); ++i) {
    if (rays[i].surface < 0) continue;
    const double power = power_of(rays, rays[i].surface);
    if (power < most || (power == most && distance_from_axis(i) >= nearest)) continue;
    most = power;
    nearest = distance_from_axis(i);
    result.ray = static_cast<int>(i);
  }
  const int brightest = rays[static_cast<std::size_t>(result.ray)].surface;
  double sum_m = 0.0;
  for (const BeamRay& ray : rays) {
    if (is_mixed ? ray.surface < 0 : ray.surface != brightest) continue;
    result.power += ray.power;
    sum_m += ray.power * ray.range_m;
  }
  result.range_m = result.power > 0.0 ? sum_m / result.power : rays[static_cast<std::size_t>(result.ray)].range_m;
  return result;
}

}  // namespace situation_awareness

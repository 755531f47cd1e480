// SPDX-License-Identifier: BSD-3-Clause
#include "situation_awareness/sim/intensity.hpp"

#include <algorithm>
#include <cmath>
#include <limits>

namespace situation_awareness {

double true_intensity(const SimulatedIntensityParams& params, const Surface& surface, double range_m,
                      double cos_incidence) {
  constexpr double kGlossExponent = 50.0;
  const double part =
      (surface.diffuse + surface.retro) * cos_incidence + surface.glossy * std::pow(cos_incidence, kGlossExponent);
  const double ratio = range_m / params.half_range_m;
  return std::min(params.max, params.gain * part / (1.0 + ratio * ratio));
}

double received_power(const SimulatedIntensityParams& params, const Surface& surface, double range_m,
                      double cos_incidence) {
  SimulatedIntensityParams receiver = params;
  receiver.gain = 1.0;
  receiver.max = std::numeric_limits<double>::infinity();
  return true_intensity(receiver, surface, range_m, cos_incidence);
}

}  // namespace situation_awareness

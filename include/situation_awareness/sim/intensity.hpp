// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include "situation_awareness/common/params.hpp"

namespace situation_awareness {

/// Intensity measured by a scanner's receiver. With the surface's diffuse, glossy and retroreflecting parts d, g and t
/// (a world's `geom_user`), the angle of incidence a and the range r,
///
///     I = min(max, gain (d cos a + g cos^50 a + t cos a) / (1 + (r / half_range)^2)) (1 + sigma n),  n ~ N(0, 1)
///
/// Lambert's law, a specular lobe some 10 deg wide, and retroreflecting tape; near the sensor the optics' overlap
/// limits the intensity, far away it falls as 1 / r^2.
struct SimulatedIntensityParams {
  double gain = 0.0;
  double half_range_m = 8.0;
  double max = 1000.0;
  double sigma = 0.03;

  template <class Self, class Visit>
  static void fields(Self& self, Visit&& visit) {
    visit("intensity_gain", self.gain, Bounds{0.0, 1e6}, "",
          "intensity of a white, diffuse surface near by, seen square on; 0: intensities are not measured");
    visit("intensity_half_range_m", self.half_range_m, Bounds{0.01, 1e4}, "m", "where it has halved");
    visit("intensity_max", self.max, Bounds{0.0, 1e9}, "", "where the receiver saturates");
    visit("intensity_sigma", self.sigma, Bounds{0.0, 1.0}, "", "standard deviation of its noise, relative");
  }
};

/// Default of a surface without an entry in the file: diffuse only.
constexpr double kDefaultDiffuse = 0.5;

/// Reflectivity of a surface, relative to a white, diffuse one.
struct Surface {
  double diffuse = kDefaultDiffuse;
  double glossy = 0.0;
  double retro = 0.0;
};

/// Without noise; 0 or more. `cos_incidence` in [0, 1].
double true_intensity(const SimulatedIntensityParams& params, const Surface& surface, double range_m,
                      double cos_incidence);

/// Light that a receiver gets from a surface, relative to a white, diffuse one near by, seen square on: the intensity
/// of a receiver of gain 1 that does not saturate.
double received_power(const SimulatedIntensityParams& params, const Surface& surface, double range_m,
                      double cos_incidence);

}  // namespace situation_awareness

// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <array>

#include "situation_awareness/common/params.hpp"

namespace situation_awareness {

/// How a real scanner differs from one with exact rays and white noise of one size. All effects are off by default,
/// and draw no random numbers then.
///
/// **Range.** A surface at range r, of which the normal has the angle a to the beam, is measured as
///
///     r + range_bias_m + range_bias_slope r + range_bias_square_1_m r^2 + grazing_bias_m (1 - cos a) + sigma n,
///     sigma = range_sigma_m + range_sigma_slope r + grazing_sigma_m (1 - cos a),  n ~ N(0, 1)
///
/// rounded to a multiple of `range_quantum_m`; range_sigma_m is the scanner's own parameter.
///
/// **Depth edges.** A beam of a width is several rays in the scan's plane. It is at a depth edge where neighbouring
/// rays meet different surfaces whose ranges differ by more than `edge_depth_m`, or where one of them meets none. There
/// it has no return, or that of the surface that returns most light, or a mixture: the mean range of all its rays by
/// the light that each returns. Elsewhere it is the ray along its axis.
///
/// **Dropped returns.** A surface from which less light is received (`received_power` in intensity.hpp) than from a
/// dark one, of diffuse reflectivity 0.1, that is seen square on at `dark_range_m`, has no return: dark surfaces, those
/// at grazing incidence, and thin ones that only a part of the beam meets.
///
/// A beam without a return is free, as drivers have it, whatever the reason.
struct ScannerErrors {
  double range_sigma_slope = 0.0;
  double grazing_sigma_m = 0.0;
  double range_bias_m = 0.0;
  double range_bias_slope = 0.0;
  double range_bias_square_1_m = 0.0;
  double grazing_bias_m = 0.0;
  double range_quantum_m = 0.0;
  double bearing_sigma_rad = 0.0;
  double beam_diameter_m = 0.0;
  double beam_divergence_rad = 0.0;
  double edge_depth_m = 0.1;
  double edge_missing_fraction = 0.0;
  double edge_mixed_fraction = 1.0;
  double dark_range_m = 0.0;
  double detection_sigma = 0.0;
  double missing_fraction = 0.0;

  template <class Self, class Visit>
  static void fields(Self& self, Visit&& visit) {
    visit("range_sigma_slope", self.range_sigma_slope, Bounds{0.0, 0.1}, "",
          "by how much the standard deviation of the ranges grows with the range, m per m");
    visit("grazing_sigma_m", self.grazing_sigma_m, Bounds{0.0, 1.0}, "m",
          "by how much it grows from square on to grazing incidence, as 1 - cosine");
    visit("range_bias_m", self.range_bias_m, Bounds{-1.0, 1.0}, "m", "measured less true range, at range 0");
    visit("range_bias_slope", self.range_bias_slope, Bounds{-0.2, 0.2}, "", "m per m that it grows by with the range");
    visit("range_bias_square_1_m", self.range_bias_square_1_m, Bounds{-0.1, 0.1}, "1/m",
          "m per m^2 that it grows by with the square of the range");
    visit("grazing_bias_m", self.grazing_bias_m, Bounds{-1.0, 1.0}, "m",
          "by how much it grows from square on to grazing incidence, as 1 - cosine");
    visit("range_quantum_m", self.range_quantum_m, Bounds{0.0, 0.1}, "m", "ranges are multiples of it; 0: any range");
    visit("bearing_sigma_rad", self.bearing_sigma_rad, Bounds{0.0, 0.1}, "rad",
          "standard deviation of the direction of each beam about the one that the scan says");
    visit("beam_diameter_m", self.beam_diameter_m, Bounds{0.0, 0.1}, "m",
          "width of the beam where it leaves the scanner");
    visit("beam_divergence_rad", self.beam_divergence_rad, Bounds{0.0, 0.1}, "rad",
          "angle by which it widens; with a diameter of 0: a beam is a ray");
    visit("edge_depth_m", self.edge_depth_m, Bounds{0.0, 100.0}, "m", "smallest step in range of a depth edge");
    visit("edge_missing_fraction", self.edge_missing_fraction, Bounds{0.0, 1.0}, "",
          "of the beams at depth edges, those without a return");
    visit("edge_mixed_fraction", self.edge_mixed_fraction, Bounds{0.0, 1.0}, "",
          "of the others there, those that mix the surfaces; the rest have the range of the brightest");
    visit("dark_range_m", self.dark_range_m, Bounds{0.0, 1000.0}, "m",
          "up to where a surface of reflectivity 0.1, seen square on, has a return; 0: every surface has one");
    visit("detection_sigma", self.detection_sigma, Bounds{0.0, 1.0}, "",
          "standard deviation of the light that decides that, relative");
    visit("missing_fraction", self.missing_fraction, Bounds{0.0, 1.0}, "",
          "of all beams that meet something, those without a return for no reason");
  }

  bool beam_has_width() const { return beam_diameter_m > 0.0 || beam_divergence_rad > 0.0; }
  bool depends_on_incidence() const { return grazing_sigma_m > 0.0 || grazing_bias_m != 0.0; }
};

/// Diffuse reflectivity of the dark surface, as of most datasheets.
constexpr double kDarkReflectivity = 0.1;

/// Mean of measured less true range.
double range_bias(const ScannerErrors& errors, double range_m, double cos_incidence);

/// What range_sigma_m grows by.
double range_sigma_growth(const ScannerErrors& errors, double range_m, double cos_incidence);

/// The nearest multiple of a quantum within [low_m, high_m], which must have one; the range in these limits if the
/// quantum is 0.
double quantised(double range_m, double quantum_m, double low_m, double high_m);

/// Rays over the width of a beam, an odd number, so that the middle one is along its axis. With so many, a mixture's
/// place between two surfaces is within 7 % of their distance of what infinitely many would give: half of the share of
/// the middle ray.
constexpr int kRaysOfBeam = 9;

/// Where a ray of a beam is, from -1 at one rim to 1 at the other.
constexpr double place_in_beam(int ray) { return (2 * ray + 1) / static_cast<double>(kRaysOfBeam) - 1.0; }

/// Its part of the light of an evenly lit, round beam; of all rays together 1.
double share_of_beam(int ray);

/// What one ray of a beam meets.
struct BeamRay {
  int surface = -1;      ///< any number of it; < 0: none
  double range_m = 0.0;  ///< to the surface
  double power = 0.0;    ///< light that it returns
};

/// The rays of a beam, from one rim to the other.
using BeamRays = std::array<BeamRay, kRaysOfBeam>;

/// Whether neighbouring rays meet different surfaces more than `edge_depth_m` apart, or one of them none.
bool is_at_depth_edge(const BeamRays& rays, double edge_depth_m);

/// The return of a beam at a depth edge.
struct EdgeReturn {
  int ray = 0;           ///< the ray nearest to the axis that meets the brightest surface
  double range_m = 0.0;  ///< mean by power over the rays that meet this surface or, of a mixture, any
  double power = 0.0;    ///< sum over the same rays
};

/// Of rays of which at least one meets a surface.
EdgeReturn edge_return(const BeamRays& rays, bool is_mixed);

}  // namespace situation_awareness

// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include "situation_awareness/common/params.hpp"
#include "situation_awareness/polylines/polylines.hpp"
#include "situation_awareness/segments/segments.hpp"

namespace situation_awareness {

/// Parameters of the extraction of polylines from segments.
struct PolylineParams {
  double max_offset_m = 0.04;
  double range_sigma_m = 0.012;
  double min_incidence_rad = 0.35;

  template <class Self, class Visit>
  static void fields(Self& self, Visit&& visit) {
    visit("max_offset_m", self.max_offset_m, Bounds{0.001, 10.0}, "m",
          "maximum distance of a hit from its polyline (Douglas and Peucker); about three times the range noise");
    visit("range_sigma_m", self.range_sigma_m, Bounds{1e-4, 1.0}, "m",
          "standard deviation of the ranges, where a scan has too few hits to show it");
    visit("min_incidence_rad", self.min_incidence_rad, Bounds{0.0, 1.5}, "rad",
          "at an end beside background, a hit behind its neighbour at less than this angle to the beam is a mixture of "
          "both surfaces");
  }

  /// Throws std::invalid_argument naming field and bound.
  void validate() const { check_bounds(*this, "polylines"); }
};

/// One polyline per segment, of whatever kind, and per run of too few hits for a segment (polygon paper, Sect. 3.1):
/// hits between two surfaces are left out, the rest is simplified (Douglas and Peucker, 1973), and each edge is the
/// maximum likelihood line of its hits (estimate_line); vertices are their intersections. Linear in the hits but for
/// the simplification. `memory`: as for limit_range.
Polylines extract_polylines(const Segments& segments, const PolylineParams& params, Polylines memory = {});

}  // namespace situation_awareness

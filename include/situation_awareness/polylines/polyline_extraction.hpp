// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include "situation_awareness/common/params.hpp"
#include "situation_awareness/polylines/polylines.hpp"
#include "situation_awareness/segments/segments.hpp"

namespace situation_awareness {

/// Parameters of the extraction of polylines from segments.
struct PolylineParams {
  double max_offset_m = 0.04;

  template <class Self, class Visit>
  static void fields(Self& self, Visit&& visit) {
    visit("max_offset_m", self.max_offset_m, Bounds{0.001, 10.0}, "m",
          "maximum distance of a hit from its polyline (Douglas and Peucker); about three times the range noise");
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

// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <set>
#include <utility>
#include <vector>

#include "input.hpp"
#include "situation_awareness/map/polygons/polygons.hpp"
#include "situation_awareness/polylines/polyline_extraction.hpp"
#include "situation_awareness/segments/segments.hpp"

namespace situation_awareness::fuzz {

/// Hits of some segments and refused runs by increasing azimuth, as those of any message are that the conversion lets
/// pass; mostly on straight and curved surfaces, with ranges up to those of scanners.
inline Segments draw_segments(Input& input) {
  constexpr std::size_t kMostBeams = 400;
  Segments segments;
  segments.stamp_ns = 1'000'000'000;
  segments.T_world_level = {{input.coordinate(10.0, 1e5), input.coordinate(10.0, 1e5)}, input.coordinate(kPi, 100.0)};
  segments.height_world_m = input.coordinate(1.0, 1e3);
  segments.range_sigma_m = input.flag() ? 0.0 : input.by_magnitude(1e-4, 1.0);
  const std::size_t beams = input.count(kMostBeams);
  segments.resolution_rad = input.flag() ? 0.0087 : input.by_magnitude(1e-4, 0.1);
  double azimuth_rad = input.uniform(-kPi, kPi);
  double range_m = input.uniform(0.1, 10.0), step = 0.0;
  for (std::size_t i = 0; i < beams; ++i) {
    azimuth_rad += segments.resolution_rad * (input.integer(0, 15) == 0 ? input.integer(0, 5) : 1);
    if (azimuth_rad > 3.0 * kPi) break;
    if (input.integer(0, 15) == 0) range_m = input.flag() ? input.uniform(0.1, 10.0) : input.by_magnitude(0.01, 1e3);
    if (input.integer(0, 7) == 0) step = input.uniform(-0.02, 0.02);
    range_m = std::clamp(range_m * (1.0 + step), 1e-2, 1e3);
    segments.free_space.azimuth_rad.push_back(static_cast<float>(azimuth_rad));
    segments.free_space.range_m.push_back(static_cast<float>(range_m));
    if (input.integer(0, 15) == 0) continue;  // no return
    segments.points.push_back({azimuth_rad,
                               range_m,
                               {range_m * std::cos(azimuth_rad), range_m * std::sin(azimuth_rad)},
                               static_cast<std::int32_t>(i),
                               BeamState::kHit});
  }
  for (std::size_t first = 0; first < segments.points.size();) {
    const std::size_t count = 1 + input.count(std::min<std::size_t>(segments.points.size() - first, 120) - 1);
    if (count < 3 || input.integer(0, 7) == 0) {
      segments.refused_runs.push_back({first, count, input.flag() ? RunRefusal::kTooFewPoints : RunRefusal::kOutside});
    } else {
      Segment segment;
      segment.first = first;
      segment.count = count;
      segment.right_end = static_cast<SegmentEnd>(input.integer(0, 3));
      segment.left_end = static_cast<SegmentEnd>(input.integer(0, 3));
      segments.segments.push_back(segment);
    }
    first += count;
  }
  return segments;
}

inline Polylines draw_polylines(Input& input) { return extract_polylines(draw_segments(input), {}); }

inline void check_polygons(const Polygons& polygons) {
  std::set<std::uint64_t> ids;
  for (const Chain& chain : polygons.chains) {
    require(chain.id != 0 && ids.insert(chain.id).second, "a chain has an id of its own");
    require(chain.vertices.size() >= 2, "a chain has two vertices at least");
    for (const ChainVertex& vertex : chain.vertices) {
      require(vertex.p_world_m.allFinite(), "a vertex is finite");
      require(vertex.sigma_m > 0.0 && std::isfinite(vertex.sigma_m), "sigma is a number above zero");
    }
    require(chain.first_seen_ns <= chain.last_seen_ns, "first seen before last seen");
    require(chain.p_exists >= 0.0 && chain.p_exists <= 1.0, "a probability is in [0, 1]");
  }
}

}  // namespace situation_awareness::fuzz

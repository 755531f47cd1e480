// SPDX-License-Identifier: BSD-3-Clause
#include "situation_awareness/pipeline/arrivals.hpp"

#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <optional>
#include <utility>

#include "situation_awareness/common/time.hpp"

namespace situation_awareness {
namespace {

/// Hits of a detection that are looked at, at most.
constexpr std::size_t kMostHits = 9;

}  // namespace

Detections Arrivals::mark(const Segments& segments, Detections detections) {
  Detections result = std::move(detections);
  hits_world_m_.reserve(kMostHits);
  for (Detection& detection : result.detections) {
    if (!detection.hidden_end) continue;
    const Segment& segment = segments.segments[detection.segment];
    const std::size_t hits = std::min(segment.count, kMostHits);
    hits_world_m_.clear();
    for (std::size_t i = 0; i < hits; ++i) {
      const Point& hit = segments.points[segment.first + i * segment.count / hits];
      hits_world_m_.push_back(segments.T_world_level * hit.p_level_m);
    }
    const std::optional<std::int64_t> free_ns = memory_.last_free_ns(hits_world_m_, segments.stamp_ns);
    detection.has_arrived = free_ns && seconds_between(*free_ns, segments.stamp_ns) <= kStep_s * kScans;
  }
  memory_.add(segments.stamp_ns, segments.T_world_level, segments.free_space);
  return result;
}

}  // namespace situation_awareness

// SPDX-License-Identifier: BSD-3-Clause
#include "situation_awareness/detections/small_segments.hpp"

#include <cstddef>
#include <utility>

#include "situation_awareness/detections/detections.hpp"
#include "situation_awareness/segments/segments.hpp"

namespace situation_awareness {
namespace {

void add_if_small(const Segments& segments, std::size_t first, std::size_t count, std::vector<SmallSegment>& found) {
  if (count < kMinSmallHits) return;
  const Point& right = segments.points[first];
  const Point& left = segments.points[first + count - 1];
  SmallSegment small;
  small.width_m = (left.p_level_m - right.p_level_m).norm();
  if (!(small.width_m <= kMaxSmallWidth_m)) return;
  for (std::size_t i = first; i < first + count; ++i) small.center_level_m += segments.points[i].p_level_m;
  small.center_level_m /= static_cast<double>(count);
  small.time_offset_s = segments.points[first + count / 2].beam * segments.time_increment_s;
  small.beams = static_cast<int>(count);
  found.push_back(small);
}

}  // namespace

std::vector<SmallSegment> small_segments(const Segments& segments, const Detections& detections,
                                         std::vector<SmallSegment> memory) {
  std::vector<SmallSegment> found = std::move(memory);
  found.clear();
  auto detection = detections.detections.cbegin();  // by ascending segment
  for (std::size_t i = 0; i < segments.segments.size(); ++i) {
    while (detection != detections.detections.cend() && detection->segment < i) ++detection;
    if (detection != detections.detections.cend() && detection->segment == i) continue;
    const Segment& segment = segments.segments[i];
    // Between two things in front of it, it is a piece of what is behind them.
    if (!is_silhouette(segment.right_end) && !is_silhouette(segment.left_end)) continue;
    add_if_small(segments, segment.first, segment.count, found);
  }
  for (const RefusedRun& run : segments.refused_runs) {
    if (run.why == RunRefusal::kTooFewPoints) add_if_small(segments, run.first, run.count, found);
  }
  return found;
}

}  // namespace situation_awareness

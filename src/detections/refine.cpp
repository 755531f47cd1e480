// SPDX-License-Identifier: BSD-3-Clause
#include "situation_awareness/detections/refine.hpp"

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <utility>

#include "situation_awareness/geometry/outline.hpp"

namespace situation_awareness {
namespace {

constexpr double kMaxOffset_m = 0.1;  // mean distance of an object's hits from its expected outline

double mean_offset_m(const Segments& segments, const Segment& segment, const Outline& outline) {
  double sum_m = 0.0;
  for (std::size_t i = segment.first; i < segment.first + segment.count; ++i) {
    sum_m += std::abs(offset_m(outline, segments.points[i].p_level_m));
  }
  return sum_m / static_cast<double>(segment.count);
}

/// Whether the hits lie, on average, on the near side of the outline, where beams enter it; on its far side no beam can
/// end.
bool on_near_side(const Segments& segments, const Segment& segment, const Outline& outline) {
  double sum = 0.0;
  for (std::size_t i = segment.first; i < segment.first + segment.count; ++i) {
    const Eigen::Vector2d& p_m = segments.points[i].p_level_m;
    sum += p_m.dot(outline.inverse_shape * (p_m - outline.center_m));
  }
  return sum < 0.0;
}

}  // namespace

std::vector<std::size_t> known_of_each(const Detections& detections, const Segments& segments,
                                       const std::vector<Ellipse>& known_level, std::vector<std::size_t> memory) {
  std::vector<std::size_t> result = std::move(memory);
  result.assign(detections.detections.size(), kNotKnown);
  if (known_level.empty()) return result;
  thread_local std::vector<Overlap> overlaps;  // kept for its memory
  overlaps = overlaps_of(segments, known_level, std::move(overlaps));
  for (std::size_t i = 0; i < result.size(); ++i) {
    const std::size_t index = detections.detections[i].segment;
    const Segment& segment = segments.segments[index];
    double nearest_m = kMaxOffset_m;
    auto overlap = std::lower_bound(overlaps.cbegin(), overlaps.cend(), index,
                                    [](const Overlap& o, std::size_t wanted) { return o.segment < wanted; });
    for (; overlap != overlaps.cend() && overlap->segment == index; ++overlap) {
      const Outline outline = outline_of(known_level[overlap->ellipse]);
      const double offset = mean_offset_m(segments, segment, outline);
      if (!(offset < nearest_m) || !on_near_side(segments, segment, outline)) continue;
      nearest_m = offset;
      result[i] = overlap->ellipse;
    }
  }
  return result;
}

Detections refine(Detections detections, const Segments& segments, const std::vector<Ellipse>& known_level,
                  const EllipseFitParams& params) {
  if (known_level.empty()) return detections;
  thread_local std::vector<std::size_t> known;  // kept for its memory
  known = known_of_each(detections, segments, known_level, std::move(known));
  for (std::size_t i = 0; i < known.size(); ++i) {
    if (known[i] == kNotKnown) continue;
    Detection& detection = detections.detections[i];
    Detection refined = refit_ellipse(segments, detection.segment, params, known_level[known[i]]);
    refined.p_ellipse = detection.p_ellipse;
    if (*detection_defect(refined, params) == '\0') detection = refined;
  }
  return detections;
}

}  // namespace situation_awareness

// SPDX-License-Identifier: BSD-3-Clause
#include "situation_awareness/detections/refine.hpp"

#include <cmath>
#include <cstddef>

#include "situation_awareness/geometry/outline.hpp"

namespace situation_awareness {
namespace {

constexpr double kMaxOffset_m = 0.1;  // mean distance of an object's hits from what is known of it

double mean_offset_m(const Segments& segments, const Segment& segment, const Outline& outline) {
  double sum_m = 0.0;
  for (std::size_t i = segment.first; i < segment.first + segment.count; ++i) {
    sum_m += std::abs(offset_m(outline, segments.points[i].p_level_m));
  }
  return sum_m / static_cast<double>(segment.count);
}

}  // namespace

Detections refine(Detections detections, const Segments& segments, const std::vector<Ellipse>& known_level,
                  const EllipseFitParams& params) {
  if (known_level.empty()) return detections;
  const std::vector<Outline> outlines = outlines_of(known_level);
  const std::vector<std::vector<int>> candidates = ellipses_by_segment(segments, known_level);
  for (Detection& detection : detections.detections) {
    const Ellipse* known = nullptr;
    double nearest_m = kMaxOffset_m;
    for (const int candidate : candidates[detection.segment]) {
      const auto k = static_cast<std::size_t>(candidate);
      const double offset = mean_offset_m(segments, segments.segments[detection.segment], outlines[k]);
      if (!(offset < nearest_m)) continue;
      nearest_m = offset;
      known = &known_level[k];
    }
    if (known == nullptr) continue;
    Detection refined = refit_ellipse(segments, detection.segment, params, *known);
    refined.p_ellipse = detection.p_ellipse;
    if (*detection_defect(refined, params) == '\0') detection = refined;
  }
  return detections;
}

}  // namespace situation_awareness

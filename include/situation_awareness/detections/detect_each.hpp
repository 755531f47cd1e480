// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include "situation_awareness/detections/detections.hpp"
#include "situation_awareness/detections/least_squares.hpp"
#include "situation_awareness/segments/segments.hpp"

namespace situation_awareness {

/// The common part of all detectors: calls `detect_one(segment index) -> Detection` for each segment of kind kObject
/// for which `refusal(segment index) -> const char*` is empty, and refuses untrustworthy results. The prior is that of
/// assess_ellipse's covariance. Segments for which `is_asked(segment index)` is false are left out.
template <class IsAsked, class DetectOne, class Refusal>
void detect_each_asked(const Segments& segments, const EllipseFitParams& params, IsAsked&& is_asked,
                       DetectOne&& detect_one, Refusal&& refusal, Detections& found) {
  for (std::size_t i = 0; i < segments.segments.size(); ++i) {
    if (segments.segments[i].kind != SegmentKind::kObject || !is_asked(i)) continue;
    const char* const reason = refusal(i);
    if (*reason != '\0') {
      found.refuse(i, reason);
      continue;
    }
    const Detection detection = detect_one(i);
    const char* const defect = detection_defect(detection, params);
    if (*defect == '\0') {
      found.detections.push_back(detection);
    } else {
      found.refuse(i, defect);
    }
  }
}

template <class DetectOne, class Refusal>
void detect_each(const Segments& segments, const EllipseFitParams& params, DetectOne&& detect_one, Refusal&& refusal,
                 Detections& found) {
  const auto all = [](std::size_t /*segment*/) { return true; };
  detect_each_asked(segments, params, all, detect_one, refusal, found);
}

/// Reason why most detectors cannot use a segment; empty if it shows at least one edge of the object.
inline const char* hidden_defect(const Segment& segment) {
  return is_silhouette(segment.right_end) || is_silhouette(segment.left_end) ? "" : detection_refusal::kBothEndsHidden;
}

/// The same for detectors that need to see at least one edge of the object.
template <class DetectOne>
void detect_each(const Segments& segments, const EllipseFitParams& params, DetectOne&& detect_one, Detections& found) {
  const auto refusal = [&](std::size_t i) { return hidden_defect(segments.segments[i]); };
  detect_each(segments, params, detect_one, refusal, found);
}

}  // namespace situation_awareness

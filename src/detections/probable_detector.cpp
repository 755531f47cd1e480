// SPDX-License-Identifier: BSD-3-Clause
#include "situation_awareness/detections/probable_detector.hpp"

#include <cstddef>
#include <utility>
#include <vector>

namespace situation_awareness {

ProbableDetector::ProbableDetector(std::unique_ptr<Detector> detector, double min_p_ellipse)
    : detector_(std::move(detector)), min_p_ellipse_(min_p_ellipse) {}

void ProbableDetector::find(const Segments& segments, Detections& found) {
  found = detector_->detect(segments, std::move(found));
  std::vector<Detection>& detections = found.detections;
  std::size_t kept = 0;
  for (const Detection& detection : detections) {
    if (detection.p_ellipse >= min_p_ellipse_) {  // false for NaN
      detections[kept++] = detection;
    } else {
      found.refuse(detection.segment, detection_refusal::kNotOneEllipse);
    }
  }
  detections.resize(kept);
}

}  // namespace situation_awareness

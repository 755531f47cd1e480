// SPDX-License-Identifier: BSD-3-Clause
#include "situation_awareness/detections/probable_detector.hpp"

#include <algorithm>
#include <utility>
#include <vector>

namespace situation_awareness {

ProbableDetector::ProbableDetector(std::unique_ptr<Detector> detector, double min_p_ellipse)
    : detector_(std::move(detector)), min_p_ellipse_(min_p_ellipse) {}

void ProbableDetector::find(const Segments& segments, Detections& found) {
  found = detector_->detect(segments, std::move(found));
  std::vector<Detection>& detections = found.detections;
  const auto refused = std::remove_if(detections.begin(), detections.end(), [this](const Detection& detection) {
    return !(detection.p_ellipse >= min_p_ellipse_);  // true for NaN
  });
  if (refused == detections.end()) return;
  found.refused["not one ellipse"] += static_cast<std::uint64_t>(detections.end() - refused);
  detections.erase(refused, detections.end());
}

}  // namespace situation_awareness

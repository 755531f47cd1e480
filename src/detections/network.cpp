// SPDX-License-Identifier: BSD-3-Clause
#include "situation_awareness/detections/network.hpp"

#include "situation_awareness/detections/detect_each.hpp"

namespace situation_awareness {

NetworkDetector::NetworkDetector(const std::string& onnx_path, const EllipseFitParams& params)
    : network_(PaperNetwork::Kind::kPolarEllipse, onnx_path), params_(params) {
  params_.validate();
}

Detections NetworkDetector::detect(const Segments& segments) {
  whole_.clear();
  for (std::size_t i = 0; i < segments.segments.size(); ++i) {
    const Segment& segment = segments.segments[i];
    if (segment.kind != SegmentKind::kObject) continue;
    if (is_silhouette(segment.right_end) && is_silhouette(segment.left_end)) whole_.push_back(i);
  }
  const std::vector<Ellipse> ellipses = network_.infer(segments, whole_);

  std::size_t next_whole = 0;
  return detect_each(segments, params_, [&](std::size_t i) {
    const bool whole = next_whole < whole_.size() && whole_[next_whole] == i;
    return whole ? assess_ellipse(segments, i, params_, ellipses[next_whole++]) : fit_ellipse(segments, i, params_);
  });
}

}  // namespace situation_awareness

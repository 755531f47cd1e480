// SPDX-License-Identifier: BSD-3-Clause
#include "situation_awareness/detections/network.hpp"

#include <cmath>

#include "situation_awareness/detections/detect_each.hpp"

namespace situation_awareness {

EllipseEstimate estimate_of(const float* answer, const SegmentEncoding& encoding, double max_radius_m) {
  const SegmentPosterior posterior = posterior_of(answer, encoding, max_radius_m);
  EllipseEstimate estimate;
  estimate.smooth_level = posterior.smooth_level;
  estimate.covariance = posterior.covariance;
  estimate.p_ellipse = 1.0 / (1.0 + std::exp(-static_cast<double>(answer[kPosteriorAnswer])));
  return estimate;
}

Detection make_detection(const Segments& segments, std::size_t segment, const EllipseFitParams& params,
                         const EllipseEstimate& estimate) {
  Detection detection = make_detection(segments, segment, params, estimate.smooth_level);
  detection.covariance = estimate.covariance;
  detection.p_ellipse = estimate.p_ellipse;
  return detection;
}

EllipseNetwork::EllipseNetwork(const std::string& onnx_path) : network_(onnx_path, kEllipseAnswer, "ellipse network") {}

const std::vector<EllipseEstimate>& EllipseNetwork::infer(const Segments& segments,
                                                          const std::vector<std::size_t>& which, double range_sigma_m,
                                                          double max_radius_m) {
  estimates_.clear();
  const float* answer = network_.infer(segments, which, range_sigma_m, max_radius_m);
  for (const SegmentEncoding& encoding : network_.encodings()) {
    estimates_.push_back(estimate_of(answer, encoding, max_radius_m));
    answer += kEllipseAnswer;
  }
  return estimates_;
}

NetworkDetector::NetworkDetector(const std::string& onnx_path, const EllipseFitParams& params)
    : network_(onnx_path), params_(params) {
  params_.validate();
}

void NetworkDetector::find(const Segments& segments, Detections& found) {
  selected_.clear();
  for (std::size_t i = 0; i < segments.segments.size(); ++i) {
    const Segment& segment = segments.segments[i];
    if (segment.kind == SegmentKind::kObject && *hidden_defect(segment) == '\0' && is_asked(i)) selected_.push_back(i);
  }
  const std::vector<EllipseEstimate>& estimates =
      network_.infer(segments, selected_, params_.range_sigma_m, params_.prior_max_radius_m);

  auto estimate = estimates.begin();
  detect_each_asked(
      segments, params_, [this](std::size_t i) { return is_asked(i); },
      [&](std::size_t i) { return make_detection(segments, i, params_, *estimate++); },
      [&](std::size_t i) { return hidden_defect(segments.segments[i]); }, found);
}

}  // namespace situation_awareness

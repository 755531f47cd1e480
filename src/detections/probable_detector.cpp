// SPDX-License-Identifier: BSD-3-Clause
#include "situation_awareness/detections/probable_detector.hpp"

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <utility>
#include <vector>

#include "situation_awareness/common/usual_room.hpp"
#include "situation_awareness/detections/box_fit.hpp"
#include "situation_awareness/detections/refine.hpp"

namespace situation_awareness {
namespace {

/// Bound of the log-odds of one segment.
constexpr double kMaxLogRatio = 7.0;
/// Probability from which on the other shape has no effect.
constexpr double kSure = 0.98;

/// Log-odds of anything but an ellipse.
double log_box_ratio(const ShapeEstimate& shape) {
  return std::clamp(std::log((shape.p_box + shape.p_other) / shape.p_ellipse), -kMaxLogRatio, kMaxLogRatio);
}

/// The detection of the segment if it is a box.
Detection box_detection(const Segments& segments, std::size_t segment, const EllipseFitParams& fit,
                        const ShapeEstimate& shape) {
  Detection detection = make_detection(segments, segment, fit, shape.smooth_level);
  detection.covariance = shape.covariance;
  detection.shape = Shape::kBox;
  detection.box_level = moment_equal_box(detection.ellipse_level);
  detection.box_level.psi_rad = shape.box_psi_level_rad;
  detection.residual_rms_m = residual_rms_m(segments, segment, detection.box_level);
  detection.covariance.diagonal().array() += detection.residual_rms_m * detection.residual_rms_m;
  detection.p_ellipse = shape.p_ellipse;
  detection.log_box_ratio = log_box_ratio(shape);
  return detection;
}

/// Mean and covariance of a detection that is either an ellipse or a box.
Detection mixture(const Detection& ellipse, const Detection& box) {
  const double p_box = 1.0 / (1.0 + std::exp(-box.log_box_ratio));
  Detection result = p_box > 0.5 ? box : ellipse;
  result.p_ellipse = box.p_ellipse;
  result.log_box_ratio = box.log_box_ratio;
  if (p_box > kSure || p_box < 1.0 - kSure) return result;
  const Vector5d z_ellipse = smooth_parameters(ellipse.ellipse_level);
  const Vector5d d = smooth_parameters(box.ellipse_level) - z_ellipse;
  result.box_level = box.box_level;
  result.ellipse_level = ellipse_from_smooth_parameters(z_ellipse + p_box * d);
  result.covariance =
      (1.0 - p_box) * ellipse.covariance + p_box * box.covariance + p_box * (1.0 - p_box) * d * d.transpose();
  return result;
}

}  // namespace

ProbableDetector::ProbableDetector(std::unique_ptr<Detector> detector, double min_p_ellipse,
                                   const EllipseFitParams& fit)
    : detector_(std::move(detector)), min_p_ellipse_(min_p_ellipse), fit_(fit) {}

ProbableDetector::ProbableDetector(std::unique_ptr<Detector> detector, std::unique_ptr<ShapeNetwork> shapes,
                                   const EllipseFitParams& fit)
    : detector_(std::move(detector)), shapes_(std::move(shapes)), fit_(fit) {}

Detections ProbableDetector::detect(const Segments& segments, const std::vector<ExpectedOutline>& known_level,
                                    Detections memory) {
  memory = detect(segments, std::move(memory));
  return refine(std::move(memory), segments, known_level, scan_fit_);
}

void ProbableDetector::find(const Segments& segments, Detections& found) {
  scan_fit_ = fit_;
  scan_fit_.range_sigma_m = std::max(fit_.range_sigma_m, segments.range_sigma_m);
  detector_->set_fit(scan_fit_);
  found = detector_->detect(segments, std::move(found));
  if (shapes_ == nullptr) {
    refuse_improbable(found);
  } else {
    compare_with_boxes(segments, found);
  }
}

void ProbableDetector::refuse_improbable(Detections& found) const {
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

void ProbableDetector::compare_with_boxes(const Segments& segments, Detections& found) {
  refused_.reserve(kUsualRoom);
  refused_ = found.refused_segments;  // a swap would hand a short memory to the caller
  found.refused_segments.clear();
  found.refused.reset();
  judged_.clear();
  judged_.reserve(kUsualRoom);
  for (const Detection& detection : found.detections) judged_.push_back(detection.segment);
  for (const RefusedSegment& segment : refused_) judged_.push_back(segment.segment);
  const std::vector<ShapeEstimate>& shapes =
      shapes_->infer(segments, judged_, scan_fit_.range_sigma_m, scan_fit_.prior_max_radius_m);

  auto shape = shapes.begin();
  for (Detection& detection : found.detections) {
    const Detection box = box_detection(segments, detection.segment, scan_fit_, *shape++);
    if (*detection_defect(box, scan_fit_) == '\0') detection = mixture(detection, box);
  }
  for (const RefusedSegment& segment : refused_) {
    const Detection box = box_detection(segments, segment.segment, scan_fit_, *shape++);
    const char* const defect = detection_defect(box, scan_fit_);
    if (*defect == '\0') {
      found.detections.push_back(box);
    } else {
      found.refuse(segment.segment, defect);
    }
  }
  std::sort(found.detections.begin(), found.detections.end(),
            [](const Detection& a, const Detection& b) { return a.segment < b.segment; });
}

}  // namespace situation_awareness

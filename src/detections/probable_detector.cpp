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
  Detection detection = unassessed_detection(segments, segment, fit, shape.smooth_level);
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

/// Returns the box that is fitted to the hits of a segment, or the one that the network judged where the fit is bad.
Detection fitted_detection(const Segments& segments, std::size_t segment, const EllipseFitParams& fit,
                           const Detection& judged) {
  Detection fitted = fit_box(segments, segment, fit);
  fitted.p_ellipse = judged.p_ellipse;
  fitted.log_box_ratio = judged.log_box_ratio;
  const double cost = box_cost(segments, segment, fit, fitted.box_level);
  const bool is_good = cost <= static_cast<double>(fitted.beams) + kGoodBoxCostMargin;
  return is_good && *detection_defect(fitted, fit) == '\0' ? fitted : judged;
}

/// Distance between the ends of a segment.
double chord_m(const Segments& segments, std::size_t segment) {
  const Point* const first = &segments.points[segments.segments[segment].first];
  return (first[segments.segments[segment].count - 1].p_level_m - first->p_level_m).norm();
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
  if (shapes_ == nullptr || known_level.empty()) {
    memory = detect(segments, std::move(memory));
    return refine(std::move(memory), segments, known_level, scan_fit_);
  }
  known_objects_.set(segments, known_level);
  refines_ = true;
  memory = detect(segments, std::move(memory));
  refines_ = false;
  known_objects_.refuse_composites(memory);
  for (Detection& detection : memory.detections) {
    if (is_refined_[detection.segment] != 0) continue;
    Detection refined;
    if (known_objects_.refined(detection.segment, detection.p_ellipse, detection.log_box_ratio, scan_fit_, refined)) {
      detection = refined;
    }
  }
  return memory;
}

void ProbableDetector::find(const Segments& segments, Detections& found) {
  scan_fit_ = fit_;
  scan_fit_.range_sigma_m = std::max(fit_.range_sigma_m, segments.range_sigma_m);
  detector_->set_fit(scan_fit_);
  if (shapes_ == nullptr) {
    found = detector_->detect(segments, std::move(found));
    refuse_improbable(found);
    return;
  }
  judge_shapes(segments);
  refine_known(segments);
  fit_large(segments);
  found = detector_->detect(segments, std::move(found), &is_refined_);
  compare_with_boxes(found);
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

/// The detection of each segment if it is a box.
void ProbableDetector::judge_shapes(const Segments& segments) {
  objects_.clear();
  objects_.reserve(kUsualRoom);
  judged_.clear();
  judged_.reserve(kUsualRoom);
  assign_with_room(judged_of_, segments.segments.size(), 0);
  for (std::size_t i = 0; i < segments.segments.size(); ++i) {
    if (segments.segments[i].kind != SegmentKind::kObject) continue;
    judged_of_[i] = objects_.size();
    objects_.push_back(i);
  }
  const std::vector<ShapeEstimate>& shapes =
      shapes_->infer(segments, objects_, scan_fit_.range_sigma_m, scan_fit_.prior_max_radius_m);
  for (std::size_t k = 0; k < objects_.size(); ++k) {
    Judged judged;
    judged.as_box = box_detection(segments, objects_[k], scan_fit_, shapes[k]);
    judged.is_large = chord_m(segments, objects_[k]) > 2.0 * scan_fit_.prior_max_radius_m;
    judged.box_defect = detection_defect(judged.as_box, scan_fit_);
    judged_.push_back(judged);
  }
}

/// A segment that may be a box is detected whatever the other detector says. Where it is refined as a known object,
/// nothing remains of what that says but the probability of its shape, which is that of the shape network.
void ProbableDetector::refine_known(const Segments& segments) {
  assign_with_room(is_refined_, segments.segments.size(), 0);
  if (!refines_) return;
  for (std::size_t k = 0; k < objects_.size(); ++k) {
    Judged& judged = judged_[k];
    if (*judged.box_defect != '\0' && !judged.is_large) continue;
    judged.is_refined = known_objects_.refined(objects_[k], judged.as_box.p_ellipse, judged.as_box.log_box_ratio,
                                               scan_fit_, judged.refined);
    is_refined_[objects_[k]] = judged.is_refined ? 1 : 0;
  }
}

/// Fits boxes to the segments that are longer than what the network was trained for, and that are of nothing known.
void ProbableDetector::fit_large(const Segments& segments) {
  for (std::size_t k = 0; k < objects_.size(); ++k) {
    Judged& judged = judged_[k];
    if (!judged.is_large || judged.is_refined) continue;
    judged.as_box = fitted_detection(segments, objects_[k], scan_fit_, judged.as_box);
    judged.box_defect = detection_defect(judged.as_box, scan_fit_);
  }
}

void ProbableDetector::compare_with_boxes(Detections& found) {
  refused_.reserve(kUsualRoom);
  refused_ = found.refused_segments;  // a swap would hand a short memory to the caller
  found.refused_segments.clear();
  found.refused.reset();
  std::vector<Detection>& detections = found.detections;
  const auto is_refined = [this](const Detection& detection) { return is_refined_[detection.segment] != 0; };
  detections.erase(std::remove_if(detections.begin(), detections.end(), is_refined), detections.end());
  for (Detection& detection : detections) {
    const Judged& judged = judged_[judged_of_[detection.segment]];
    if (*judged.box_defect == '\0') detection = mixture(detection, judged.as_box);
  }
  for (const RefusedSegment& segment : refused_) {
    const Judged& judged = judged_[judged_of_[segment.segment]];
    if (judged.is_refined) continue;
    if (*judged.box_defect == '\0') {
      detections.push_back(judged.as_box);
    } else {
      found.refuse(segment.segment, judged.box_defect);
    }
  }
  for (const Judged& judged : judged_) {
    if (judged.is_refined) detections.push_back(judged.refined);
  }
  std::sort(detections.begin(), detections.end(),
            [](const Detection& a, const Detection& b) { return a.segment < b.segment; });
}

}  // namespace situation_awareness

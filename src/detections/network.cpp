// SPDX-License-Identifier: BSD-3-Clause
#include "situation_awareness/detections/network.hpp"

#include <algorithm>
#include <cmath>
#include <stdexcept>

#include <Eigen/Geometry>
#include <Eigen/LU>

#include "situation_awareness/detections/detect_each.hpp"

namespace situation_awareness {
namespace {

// o          the network's output                                                      22
// w, R   half width of the segment and largest radius of the prior, in m
// A      lower triangular factor of the precision in the segment's frame, in 1/R   5x5
// J      from the segment's frame to the level frame                               5x5
// (docs/math/detections.md, "Output"; scripts/train/ellipse_network.py)

constexpr int kPoint = 5;
constexpr int kFactor = 15;
constexpr int kOutputs = kPoint + kFactor + 2;
static_assert(kOutputs == static_cast<int>(kEllipseAnswer));
constexpr double kFactorLogDiagonal = 3.0;
constexpr double kFactorScale = 10.0;
constexpr double kMaxLog = 15.0;  // of exponents, against overflow

double bounded_exp(double x) { return std::exp(std::clamp(x, -kMaxLog, kMaxLog)); }

Matrix5d precision_factor(const float* o) {
  Matrix5d A = Matrix5d::Zero();
  for (int i = 0; i < kPoint; ++i) {
    for (int j = 0; j < i; ++j) A(i, j) = kFactorScale * static_cast<double>(*o++);
    A(i, i) = bounded_exp(kFactorLogDiagonal + static_cast<double>(*o++));
  }
  return A;
}

}  // namespace

EllipseEstimate estimate_of(const float* answer, const SegmentEncoding& encoding, double max_radius_m) {
  const float* const o = answer;
  const double w = encoding.half_width_m;
  const double R = max_radius_m;
  Vector5d smooth_segment;
  smooth_segment << 0.5 * w, 0.0, w, 0.0, 0.0;
  for (int i = 0; i < kPoint; ++i) smooth_segment(i) += R * static_cast<double>(o[i]);

  const Matrix5d A = precision_factor(o + kPoint);
  Matrix5d J = Matrix5d::Identity();
  J.topLeftCorner<2, 2>() = Eigen::Rotation2Dd(encoding.azimuth_rad).toRotationMatrix();
  J.bottomRightCorner<2, 2>() = Eigen::Rotation2Dd(2.0 * encoding.azimuth_rad).toRotationMatrix();
  // The covariance is L L^T with L = J A^-1, times what makes its 90 % region hold 90 %.
  const Matrix5d L = J * A.triangularView<Eigen::Lower>().solve(Matrix5d::Identity());
  const double scale = R * R * bounded_exp(o[kPoint + kFactor]);

  EllipseEstimate estimate;
  estimate.smooth_level = to_level_frame(encoding, smooth_segment);
  const Matrix5d covariance = scale * L * L.transpose();
  estimate.covariance = 0.5 * (covariance + covariance.transpose());
  estimate.p_ellipse = 1.0 / (1.0 + std::exp(-static_cast<double>(o[kOutputs - 1])));
  return estimate;
}

Detection make_detection(const Segments& segments, std::size_t segment, const EllipseFitParams& params,
                         const EllipseEstimate& estimate) {
  Detection detection = make_detection(segments, segment, params, estimate.smooth_level);
  detection.covariance = estimate.covariance;
  detection.p_ellipse = estimate.p_ellipse;
  return detection;
}

EllipseNetwork::EllipseNetwork(const std::string& onnx_path) : model_(onnx_path) {
  if (model_.inputs() != static_cast<int>(SegmentEncoding::kInputs) || model_.outputs() != kOutputs) {
    throw std::runtime_error(onnx_path + ": not usable as the ellipse network (it makes " +
                             std::to_string(model_.outputs()) + " numbers of " + std::to_string(model_.inputs()) + ")");
  }
}

const std::vector<EllipseEstimate>& EllipseNetwork::infer(const Segments& segments,
                                                          const std::vector<std::size_t>& which, double range_sigma_m,
                                                          double max_radius_m) {
  encodings_.clear();
  estimates_.clear();
  if (which.empty()) return estimates_;

  float* input = model_.resize(static_cast<int>(which.size()));
  for (const std::size_t i : which) {
    encodings_.push_back(encode(segments, segments.segments[i], range_sigma_m, max_radius_m));
    input = std::copy(encodings_.back().inputs.begin(), encodings_.back().inputs.end(), input);
  }
  const float* answer = model_.forward();
  for (const SegmentEncoding& encoding : encodings_) {
    estimates_.push_back(estimate_of(answer, encoding, max_radius_m));
    answer += kOutputs;
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
    if (segment.kind == SegmentKind::kObject && *hidden_defect(segment) == '\0') selected_.push_back(i);
  }
  const std::vector<EllipseEstimate>& estimates =
      network_.infer(segments, selected_, params_.range_sigma_m, params_.prior_max_radius_m);

  auto estimate = estimates.begin();
  detect_each(
      segments, params_, [&](std::size_t i) { return make_detection(segments, i, params_, *estimate++); }, found);
}

}  // namespace situation_awareness

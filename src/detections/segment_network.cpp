// SPDX-License-Identifier: BSD-3-Clause
#include "situation_awareness/detections/segment_network.hpp"

#include <algorithm>
#include <cmath>
#include <stdexcept>

#include <Eigen/Geometry>

#include "situation_awareness/estimation/cholesky.hpp"

namespace situation_awareness {
namespace {

// o      the first outputs of a network                                                21
// w, R   half width of the segment and largest radius of the prior, in m
// A      lower triangular factor of the precision in the segment's frame, in 1/R   5x5
// J      from the segment's frame to the level frame                               5x5
// (docs/math/detections.md, "Output"; scripts/train/segment_network.py)

constexpr int kPoint = 5;
constexpr int kFactor = 15;
static_assert(kPoint + kFactor + 1 == static_cast<int>(kPosteriorAnswer));
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

SegmentPosterior posterior_of(const float* answer, const SegmentEncoding& encoding, double max_radius_m) {
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
  const Matrix5d L = J * inverse_of_lower(A);
  const double scale = R * R * bounded_exp(o[kPoint + kFactor]);

  SegmentPosterior posterior;
  posterior.smooth_level = to_level_frame(encoding, smooth_segment);
  const Matrix5d covariance = scale * L * L.transpose();
  posterior.covariance = 0.5 * (covariance + covariance.transpose());
  return posterior;
}

SegmentNetwork::SegmentNetwork(const std::string& onnx_path, std::size_t outputs, const std::string& use)
    : model_(onnx_path) {
  if (model_.inputs() != static_cast<int>(SegmentEncoding::kInputs) || model_.outputs() != static_cast<int>(outputs)) {
    throw std::runtime_error(onnx_path + ": not usable as the " + use + " (it makes " +
                             std::to_string(model_.outputs()) + " numbers of " + std::to_string(model_.inputs()) + ")");
  }
}

const float* SegmentNetwork::infer(const Segments& segments, const std::vector<std::size_t>& which,
                                   double range_sigma_m, double max_radius_m) {
  encodings_.clear();
  if (which.empty()) return nullptr;
  float* input = model_.resize(static_cast<int>(which.size()));
  for (const std::size_t i : which) {
    encodings_.push_back(encode(segments, segments.segments[i], range_sigma_m, max_radius_m));
    input = std::copy(encodings_.back().inputs.begin(), encodings_.back().inputs.end(), input);
  }
  return model_.forward();
}

}  // namespace situation_awareness

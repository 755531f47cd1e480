// SPDX-License-Identifier: BSD-3-Clause
#include "situation_awareness/detections/shape_network.hpp"

#include <algorithm>
#include <array>
#include <cmath>

#include "situation_awareness/geometry/angles.hpp"
#include "situation_awareness/geometry/ellipse.hpp"

namespace situation_awareness {
namespace {

// Outputs behind those of the posterior (docs/math/detections.md, "The shape network"; scripts/train/shape_network.py).
constexpr std::size_t kLogits = kPosteriorAnswer;  ///< of ellipse, box, other
constexpr std::size_t kClasses = 3;
constexpr std::size_t kDirection = kLogits + kClasses;  ///< (cos 4 psi, sin 4 psi) in the segment's frame
static_assert(kDirection + 2 == kShapeAnswer);

std::array<double, kClasses> probabilities(const float* logits) {
  const double top = *std::max_element(logits, logits + kClasses);
  std::array<double, kClasses> p{};
  double sum = 0.0;
  for (std::size_t i = 0; i < kClasses; ++i) sum += p[i] = std::exp(static_cast<double>(logits[i]) - top);
  for (double& value : p) value /= sum;
  return p;
}

}  // namespace

ShapeEstimate shape_of(const float* answer, const SegmentEncoding& encoding, double max_radius_m) {
  const SegmentPosterior posterior = posterior_of(answer, encoding, max_radius_m);
  const std::array<double, kClasses> p = probabilities(answer + kLogits);
  ShapeEstimate estimate;
  estimate.p_ellipse = p[0];
  estimate.p_box = p[1];
  estimate.p_other = p[2];
  estimate.smooth_level = posterior.smooth_level;
  estimate.covariance = posterior.covariance;
  const double psi_segment_rad =
      0.25 * std::atan2(static_cast<double>(answer[kDirection + 1]), static_cast<double>(answer[kDirection]));
  const double major_rad = 0.5 * std::atan2(posterior.smooth_level(4), posterior.smooth_level(3));
  estimate.box_psi_level_rad = nearest_axis(encoding.azimuth_rad + psi_segment_rad, major_rad);
  return estimate;
}

ShapeNetwork::ShapeNetwork(const std::string& onnx_path) : network_(onnx_path, kShapeAnswer, "shape network") {}

const std::vector<ShapeEstimate>& ShapeNetwork::infer(const Segments& segments, const std::vector<std::size_t>& which,
                                                      double range_sigma_m, double max_radius_m) {
  estimates_.clear();
  const float* answer = network_.infer(segments, which, range_sigma_m, max_radius_m);
  for (const SegmentEncoding& encoding : network_.encodings()) {
    estimates_.push_back(shape_of(answer, encoding, max_radius_m));
    answer += kShapeAnswer;
  }
  return estimates_;
}

}  // namespace situation_awareness

// SPDX-License-Identifier: BSD-3-Clause
#include "situation_awareness/detections/network.hpp"

#include <algorithm>
#include <cmath>
#include <stdexcept>

#include "situation_awareness/detections/detect_each.hpp"

namespace situation_awareness {
namespace {

constexpr int kMiddle = EllipseNetwork::kBeams / 2;
constexpr int kOutputs = 5;
constexpr double kRangeScale = 0.1;     // docs/math/detections.md, eq. 2
constexpr double kDeviationGain = 4.0;  // the same
constexpr double kMinRadiusM = 0.01;    // the network's answer is not bounded

/// Hits of one segment on the network's grid: ranges at the indices first ... first + ranges.size() - 1.
struct Resampled {
  int first = 0;
  std::vector<double> ranges_m;
  double mean_range_m = 0.0;
};

/// Docs/math/detections.md, eq. 1. The middle point lies exactly on the grid, so there is always a hit.
Resampled resample(const Segments& segments, const Segment& segment) {
  const Point* const points = &segments.points[segment.first];
  const std::size_t count = segment.count;
  const double middle_rad = points[count / 2].azimuth_rad;
  const auto in_beams = [&](double azimuth_rad) { return (azimuth_rad - middle_rad) / EllipseNetwork::kResolutionRad; };

  // A beam exactly half a beam beyond the outermost hit is no hit: it belongs as much to the miss beside it. The
  // tolerance is that of single-precision angles over a scan.
  const double reach_beams = 0.5 * segments.resolution_rad / EllipseNetwork::kResolutionRad - 1e-3;
  const double low = std::ceil(in_beams(points[0].azimuth_rad) - reach_beams);
  const double high = std::floor(in_beams(points[count - 1].azimuth_rad) + reach_beams);
  const int first = static_cast<int>(std::clamp(low, static_cast<double>(-kMiddle), 0.0));
  const int last = static_cast<int>(std::clamp(high, 0.0, static_cast<double>(kMiddle)));

  Resampled resampled;
  resampled.first = kMiddle + first;
  std::size_t right = 0;  // the last point at or before the beam
  double sum = 0.0;
  for (int k = first; k <= last; ++k) {
    const double beam = k;
    while (right + 1 < count && in_beams(points[right + 1].azimuth_rad) <= beam) ++right;
    double range_m = points[right].range_m;
    const double from = in_beams(points[right].azimuth_rad);
    if (right + 1 < count && beam > from) {
      const double to = in_beams(points[right + 1].azimuth_rad);
      range_m += (beam - from) / (to - from) * (points[right + 1].range_m - range_m);
    }
    resampled.ranges_m.push_back(range_m);
    sum += range_m;
  }
  resampled.mean_range_m = sum / static_cast<double>(resampled.ranges_m.size());
  return resampled;
}

/// The network's answer (docs/math/detections.md, eq. 3) as an ellipse in the level frame.
Ellipse to_level(const float* answer, double mean_range_m, double middle_rad) {
  const double m = answer[2];
  const double p = answer[3];
  const double q = answer[4];
  const double half_difference = std::hypot(p, q);
  Ellipse ellipse_segment;
  ellipse_segment.center_m = {mean_range_m + answer[0], static_cast<double>(answer[1])};
  ellipse_segment.psi_rad = 0.5 * std::atan2(q, p);
  ellipse_segment.rx_m = std::max(m + half_difference, kMinRadiusM);
  ellipse_segment.ry_m = std::max(m - half_difference, kMinRadiusM);
  const Pose2 T_level_segment{Eigen::Vector2d::Zero(), middle_rad};
  return canonical(T_level_segment * ellipse_segment);
}

}  // namespace

EllipseNetwork::EllipseNetwork(const std::string& onnx_path) : model_(onnx_path) {
  if (model_.inputs() != kBeams || model_.outputs() != kOutputs) {
    throw std::runtime_error(onnx_path + ": not usable as the ellipse network (it makes " +
                             std::to_string(model_.outputs()) + " numbers of " + std::to_string(model_.inputs()) + ")");
  }
}

std::vector<Ellipse> EllipseNetwork::infer(const Segments& segments, const std::vector<std::size_t>& which) {
  std::vector<Ellipse> ellipses;
  if (which.empty()) return ellipses;

  float* const inputs = model_.resize(static_cast<int>(which.size()));
  std::vector<double> mean_ranges_m;
  for (std::size_t row = 0; row < which.size(); ++row) {
    const Resampled hits = resample(segments, segments.segments[which[row]]);
    float* const input = inputs + row * kBeams + hits.first;
    std::transform(hits.ranges_m.begin(), hits.ranges_m.end(), input, [&](double range_m) {
      return static_cast<float>(kRangeScale * hits.mean_range_m + kDeviationGain * (range_m - hits.mean_range_m));
    });
    mean_ranges_m.push_back(hits.mean_range_m);
  }

  const float* const answers = model_.forward();
  for (std::size_t row = 0; row < which.size(); ++row) {
    const Segment& segment = segments.segments[which[row]];
    const double middle_rad = segments.points[segment.first + segment.count / 2].azimuth_rad;
    ellipses.push_back(to_level(answers + row * kOutputs, mean_ranges_m[row], middle_rad));
  }
  return ellipses;
}

NetworkDetector::NetworkDetector(const std::string& onnx_path, const EllipseFitParams& params)
    : network_(onnx_path), params_(params) {
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

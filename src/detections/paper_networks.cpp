// SPDX-License-Identifier: BSD-3-Clause
#include "situation_awareness/detections/paper_networks.hpp"

#include <algorithm>
#include <cmath>
#include <stdexcept>

#include "situation_awareness/detections/detect_each.hpp"
#include "situation_awareness/geometry/angles.hpp"

namespace situation_awareness {
namespace {

using Kind = PaperNetwork::Kind;

constexpr int kMiddle = PaperNetwork::kBeams / 2;
constexpr double kRangeScale = 0.1;     // docs/math/paper_networks.md, eq. 2
constexpr double kDeviationGain = 4.0;  // eq. 2
constexpr double kMinRadiusM = 0.01;    // the networks' outputs are not bounded

int outputs_of(Kind kind) { return kind == Kind::kCircle ? 3 : 5; }

/// Input of beams without a hit (circle paper, Sect. IV-A: -1; ellipse paper, Sect. IV: 0).
float input_without_hit(Kind kind) { return kind == Kind::kCircle ? -1.0F : 0.0F; }

/// Azimuth of the network's middle beam: that of the segment's middle point in its own polar frame, else straight
/// ahead, by as many whole turns as the segment's azimuths have.
double middle_azimuth_rad(Kind kind, const Segments& segments, const Segment& segment) {
  const double azimuth_rad = segments.points[segment.first + segment.count / 2].azimuth_rad;
  return kind == Kind::kPolarEllipse ? azimuth_rad : 2.0 * kPi * std::round(azimuth_rad / (2.0 * kPi));
}

/// The network's beams that hit a segment, first ... last; none where first > last.
struct BeamRange {
  int first = 0;
  int last = 0;
};

double in_beams(double azimuth_rad, double middle_rad) {
  return (azimuth_rad - middle_rad) / PaperNetwork::kResolutionRad;
}

/// Docs/math/paper_networks.md, eq. 1.
BeamRange beams_on(const Segments& segments, const Segment& segment, double middle_rad) {
  // A beam exactly half a beam beyond the outermost hit is no hit. The tolerance is that of single-precision angles
  // over a scan, and is also applied to the hits.
  const double reach_beams = std::max(0.5 * segments.resolution_rad / PaperNetwork::kResolutionRad - 1e-3, 1e-3);
  const double low = in_beams(segments.points[segment.first].azimuth_rad, middle_rad) - reach_beams;
  const double high =
      in_beams(segments.points[segment.first + segment.count - 1].azimuth_rad, middle_rad) + reach_beams;
  constexpr double kEdge = kMiddle;  // clamped as doubles, since they may exceed an int
  return {kMiddle + static_cast<int>(std::ceil(std::clamp(low, -kEdge, kEdge + 1.0))),
          kMiddle + static_cast<int>(std::floor(std::clamp(high, -kEdge - 1.0, kEdge)))};
}

/// Ranges at which the beams would have hit the segment (docs/math/paper_networks.md, eq. 1).
std::vector<double> ranges_on(const Segments& segments, const Segment& segment, double middle_rad, BeamRange beams) {
  const Point* const points = &segments.points[segment.first];
  std::vector<double> ranges_m;
  std::size_t right = 0;  // the last point at or before the beam
  for (int k = beams.first; k <= beams.last; ++k) {
    const double beam = k - kMiddle;
    while (right + 1 < segment.count && in_beams(points[right + 1].azimuth_rad, middle_rad) <= beam) ++right;
    double range_m = points[right].range_m;
    const double from = in_beams(points[right].azimuth_rad, middle_rad);
    if (right + 1 < segment.count && beam > from) {
      const double to = in_beams(points[right + 1].azimuth_rad, middle_rad);
      range_m += (beam - from) / (to - from) * (points[right + 1].range_m - range_m);
    }
    ranges_m.push_back(range_m);
  }
  return ranges_m;
}

double mean_of(const std::vector<double>& values) {
  double sum = 0.0;
  for (const double value : values) sum += value;
  return sum / static_cast<double>(values.size());
}

/// The network's output in the frame whose x axis is its middle beam (docs/math/paper_networks.md, eq. 3).
Ellipse ellipse_of(Kind kind, const float* answer, double mean_range_m) {
  Ellipse ellipse;
  ellipse.center_m = {static_cast<double>(answer[0]), static_cast<double>(answer[1])};
  switch (kind) {
    case Kind::kEllipse:
      ellipse.psi_rad = answer[2];
      ellipse.rx_m = answer[3];
      ellipse.ry_m = answer[4];
      break;
    case Kind::kCircle:
      ellipse.rx_m = ellipse.ry_m = answer[2];
      break;
    case Kind::kPolarEllipse: {
      const double m = answer[2];
      const double p = answer[3];
      const double q = answer[4];
      const double half_difference = std::hypot(p, q);
      ellipse.center_m.x() += mean_range_m;
      ellipse.psi_rad = 0.5 * std::atan2(q, p);
      ellipse.rx_m = m + half_difference;
      ellipse.ry_m = m - half_difference;
      break;
    }
  }
  ellipse.rx_m = std::max(ellipse.rx_m, kMinRadiusM);
  ellipse.ry_m = std::max(ellipse.ry_m, kMinRadiusM);
  return ellipse;
}

}  // namespace

PaperNetwork::PaperNetwork(Kind kind, const std::string& onnx_path) : kind_(kind), model_(onnx_path) {
  if (model_.inputs() == kBeams && model_.outputs() == outputs_of(kind)) return;
  throw std::runtime_error(onnx_path + ": not usable here (it makes " + std::to_string(model_.outputs()) +
                           " numbers of " + std::to_string(model_.inputs()) + ", not " +
                           std::to_string(outputs_of(kind)) + " of " + std::to_string(kBeams) + ")");
}

bool PaperNetwork::sees(const Segments& segments, std::size_t segment) const {
  const Segment& piece = segments.segments[segment];
  const BeamRange beams = beams_on(segments, piece, middle_azimuth_rad(kind_, segments, piece));
  return beams.first <= beams.last;
}

std::vector<Ellipse> PaperNetwork::infer(const Segments& segments, const std::vector<std::size_t>& which) {
  std::vector<Ellipse> ellipses;
  if (which.empty()) return ellipses;

  float* const inputs = model_.resize(static_cast<int>(which.size()), input_without_hit(kind_));
  std::vector<double> mean_ranges_m;
  for (std::size_t row = 0; row < which.size(); ++row) {
    const Segment& segment = segments.segments[which[row]];
    const double middle_rad = middle_azimuth_rad(kind_, segments, segment);
    const BeamRange beams = beams_on(segments, segment, middle_rad);
    const std::vector<double> ranges_m = ranges_on(segments, segment, middle_rad, beams);
    const double mean_range_m = mean_of(ranges_m);
    std::transform(ranges_m.begin(), ranges_m.end(), inputs + row * kBeams + beams.first, [&](double range_m) {
      const double deviation_m = range_m - mean_range_m;
      return static_cast<float>(kind_ == Kind::kPolarEllipse ? kRangeScale * mean_range_m + kDeviationGain * deviation_m
                                                             : kRangeScale * range_m);
    });
    mean_ranges_m.push_back(mean_range_m);
  }

  const float* answer = model_.forward();
  for (std::size_t row = 0; row < which.size(); ++row, answer += model_.outputs()) {
    const double middle_rad = middle_azimuth_rad(kind_, segments, segments.segments[which[row]]);
    const Pose2 T_level_middle{Eigen::Vector2d::Zero(), middle_rad};
    ellipses.push_back(canonical(T_level_middle * ellipse_of(kind_, answer, mean_ranges_m[row])));
  }
  return ellipses;
}

PaperNetworkDetector::PaperNetworkDetector(PaperNetwork::Kind kind, const std::string& onnx_path,
                                           const EllipseFitParams& params)
    : network_(kind, onnx_path), params_(params) {
  params_.validate();
}

void PaperNetworkDetector::find(const Segments& segments, Detections& found) {
  seen_.clear();
  for (std::size_t i = 0; i < segments.segments.size(); ++i) {
    if (segments.segments[i].kind == SegmentKind::kObject && network_.sees(segments, i)) seen_.push_back(i);
  }
  const std::vector<Ellipse> ellipses = network_.infer(segments, seen_);

  std::size_t next = 0;
  const auto detect_one = [&](std::size_t i) { return assess_ellipse(segments, i, params_, ellipses[next++]); };
  const auto refusal = [&](std::size_t i) {
    return next < seen_.size() && seen_[next] == i ? "" : detection_refusal::kOutsideFieldOfView;
  };
  detect_each(segments, params_, detect_one, refusal, found);
}

}  // namespace situation_awareness

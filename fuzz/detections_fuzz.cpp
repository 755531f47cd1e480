// SPDX-License-Identifier: BSD-3-Clause
// From any segments, and any output of a network, to valid detections.
#include <array>
#include <memory>
#include <numeric>
#include <vector>

#include "input.hpp"
#include "situation_awareness/detections/detections.hpp"
#include "situation_awareness/detections/least_squares.hpp"
#include "situation_awareness/detections/network.hpp"
#include "situation_awareness/detections/refine.hpp"
#include "situation_awareness/detections/segment_encoding.hpp"
#include "support/covariance.hpp"

namespace situation_awareness::fuzz {
namespace {

/// Hits on an ellipse, or arbitrary ones, next to the previous hits.
void append_points(Input& input, std::size_t count, Segments& segments) {
  const bool on_ellipse = input.flag();
  const Ellipse ellipse = input.ellipse();
  const double range_m = input.by_magnitude(1e-3, 1e3);
  const double azimuth_rad = segments.points.empty() ? input.coordinate(kPi, 10.0)
                                                     : segments.points.back().azimuth_rad + input.uniform(0.0, 1.0);
  const bool any_point = input.integer(0, 7) == 0;
  for (std::size_t i = 0; i < count; ++i) {
    Point point;
    point.azimuth_rad = azimuth_rad + static_cast<double>(i) * segments.resolution_rad;
    const Eigen::Vector2d u(std::cos(point.azimuth_rad), std::sin(point.azimuth_rad));
    const auto hit_m = on_ellipse ? intersect_ray(ellipse, Eigen::Vector2d::Zero(), u) : std::nullopt;
    point.range_m = hit_m && *hit_m > 0.0 ? *hit_m : range_m + (input.left() ? input.coordinate(0.02, 1.0) : 0.0);
    point.p_level_m = point.range_m * u;
    if (any_point) {  // as in an unchecked message
      point.range_m = input.signed_by_magnitude(1e6);
      point.p_level_m = {input.signed_by_magnitude(1e6), input.signed_by_magnitude(1e6)};
    }
    point.beam = static_cast<int>(segments.points.size());
    point.state = BeamState::kHit;
    segments.points.push_back(point);
  }
}

Segments draw_segments(Input& input) {
  Segments segments;
  segments.stamp_ns = input.any_int64();
  segments.T_world_level = input.pose2();
  segments.resolution_rad = input.flag() ? radians(0.25) : input.by_magnitude(1e-9, 10.0);
  segments.time_increment_s = input.flag() ? 0.0 : input.uniform(0.0, 1.0);
  segments.range_sigma_m = input.flag() ? 0.0 : input.by_magnitude(1e-6, 10.0);
  for (std::size_t i = input.count(5); i > 0; --i) {
    Segment segment;
    segment.first = segments.points.size();
    segment.count = 1 + input.count(40);
    segment.kind = input.integer(0, 7) == 0 ? SegmentKind::kStructure : SegmentKind::kObject;
    segment.right_end = static_cast<SegmentEnd>(input.integer(0, 3));
    segment.left_end = static_cast<SegmentEnd>(input.integer(0, 3));
    if (!is_silhouette(segment.right_end)) segment.right_hidden_rad = input.uniform(0.0, kPi);
    if (!is_silhouette(segment.left_end)) segment.left_hidden_rad = input.uniform(0.0, kPi);
    append_points(input, segment.count, segments);
    segments.segments.push_back(segment);
  }
  return segments;
}

EllipseFitParams draw_fit_params(Input& input) {
  auto params = draw_params<EllipseFitParams>(input);
  params.max_iterations = std::min(params.max_iterations, 30);  // time is not tested here
  if (!(params.min_radius_m < params.max_radius_m)) params = {};
  params.validate();
  return params;
}

void check_detections(const Detections& found, const Segments& segments, const EllipseFitParams& params) {
  const auto objects = std::count_if(segments.segments.begin(), segments.segments.end(),
                                     [](const Segment& segment) { return segment.kind == SegmentKind::kObject; });
  const std::uint64_t refused =
      std::accumulate(found.refused.begin(), found.refused.end(), std::uint64_t{0},
                      [](std::uint64_t sum, const Counters::Entry& entry) { return sum + entry.second; });
  require(found.detections.size() + refused == static_cast<std::uint64_t>(objects),
          "every object's segment is detected or refused");
  require(found.stamp_ns == segments.stamp_ns, "detections keep the stamp");
  for (std::size_t i = 0; i < found.detections.size(); ++i) {
    const Detection& detection = found.detections[i];
    const Ellipse& ellipse = detection.ellipse_level;
    require(i == 0 || detection.segment > found.detections[i - 1].segment,
            "at most one detection per segment, in order");
    require(detection.segment < segments.segments.size(), "a detection names a segment that is there");
    require(detection.beams == static_cast<int>(segments.segments[detection.segment].count), "its beams are its hits");
    require(*detection_defect(detection, params) == '\0', "what is not to be trusted is refused");
    require(std::isfinite(detection.residual_rms_m + detection.time_offset_s), "detections are finite");
    require(detection.p_ellipse >= 0.0 && detection.p_ellipse <= 1.0, "p_ellipse is a probability");
    require(ellipse.center_m.allFinite() && std::isfinite(ellipse.psi_rad), "ellipses are finite");
    require(ellipse.rx_m >= ellipse.ry_m && ellipse.ry_m >= 0.999 * params.min_radius_m, "rx >= ry > 0");
    require(is_covariance(detection.covariance), "a covariance is symmetric and positive");
    require((detection.covariance.diagonal().array() > 0.0).all(), "nothing is certain");
  }
}

void check_encoding(Input& input, const Segments& segments, const EllipseFitParams& params) {
  for (std::size_t i = 0; i < segments.segments.size(); ++i) {
    const SegmentEncoding encoding =
        encode(segments, segments.segments[i], params.range_sigma_m, params.prior_max_radius_m);
    const Ellipse ellipse = input.ellipse();
    const Vector5d smooth = smooth_parameters(ellipse);
    if (std::isfinite(encoding.mean_range_m) && std::isfinite(encoding.azimuth_rad)) {
      const double size_m = smooth.cwiseAbs().maxCoeff() + std::abs(encoding.mean_range_m);
      const Vector5d back = to_level_frame(encoding, to_segment_frame(encoding, ellipse));
      require((back - smooth).cwiseAbs().maxCoeff() <= 1e-9 * size_m, "into the segment's frame and back");
    }
    std::array<float, kEllipseAnswer> answer{};
    const bool any = input.flag();
    for (float& number : answer) {
      number = any ? input.any<float>() : static_cast<float>(input.coordinate(2.0, 1e4));
    }
    const EllipseEstimate estimate = estimate_of(answer.data(), encoding, params.prior_max_radius_m);
    const Detection detection = make_detection(segments, i, params, estimate);
    if (*detection_defect(detection, params) != '\0') continue;
    require(is_covariance(detection.covariance), "a covariance is symmetric and positive");
    require(detection.ellipse_level.rx_m >= detection.ellipse_level.ry_m &&
                detection.ellipse_level.ry_m >= 0.999 * params.min_radius_m,
            "rx >= ry > 0");
  }
}

void run(Input input) {
  const Segments segments = draw_segments(input);
  const EllipseFitParams params = draw_fit_params(input);
  check_encoding(input, segments, params);

  LeastSquaresDetector least_squares(params);
  static NetworkDetector network(SITUATION_AWARENESS_SOURCE_DIR "/models/ellipse.onnx", {});
  const bool by_network = input.flag();
  const EllipseFitParams used = by_network ? EllipseFitParams{} : params;
  const Detections found = by_network ? network.detect(segments) : least_squares.detect(segments);
  check_detections(found, segments, used);

  std::vector<ExpectedOutline> known_level;
  for (std::size_t i = input.count(4); i > 0; --i) known_level.push_back(input.ellipse());
  for (const Detection& detection : found.detections) {
    if (input.flag()) known_level.push_back(detection.ellipse_level);
  }
  const Detections refined = refine(found, segments, known_level, used);
  check_detections(refined, segments, used);
  require(refined.detections.size() == found.detections.size(), "to refine is to keep all");
  for (std::size_t i = 0; i < found.detections.size(); ++i) {
    require(refined.detections[i].p_ellipse == found.detections[i].p_ellipse, "to refine keeps p_ellipse");
  }
}

}  // namespace
}  // namespace situation_awareness::fuzz

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  situation_awareness::fuzz::run({data, size});
  return 0;
}

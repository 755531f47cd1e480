// SPDX-License-Identifier: BSD-3-Clause
#include "situation_awareness/detections/segment_encoding.hpp"

#include <algorithm>
#include <cmath>

#include "situation_awareness/detections/least_squares.hpp"
#include "situation_awareness/geometry/angles.hpp"

namespace situation_awareness {
namespace {

/// Beams without a return beside a segment, from which on its silhouette may be anywhere beyond.
constexpr double kFewBeams = 3.5;

constexpr double kMaxHalfAngleRad = radians(85.0);  // of a segment: beyond, the sensor is almost inside the object

/// Mean of the ranges over each slot, by nearest-neighbour interpolation of the hits.
std::array<double, SegmentEncoding::kSlots> profile(const Point* points, std::size_t count, double right_rad,
                                                    double left_rad) {
  constexpr std::size_t n = SegmentEncoding::kSlots;
  std::array<double, n> sums{};
  const double slot_rad = (left_rad - right_rad) / static_cast<double>(n);
  std::size_t slot = 0;
  double from_rad = right_rad;
  for (std::size_t i = 0; i < count; ++i) {
    const bool last = i + 1 == count;
    const double to_rad = last ? left_rad : 0.5 * (points[i].azimuth_rad + points[i + 1].azimuth_rad);
    while (slot + 1 < n && right_rad + static_cast<double>(slot + 1) * slot_rad < to_rad) {
      const double border_rad = right_rad + static_cast<double>(slot + 1) * slot_rad;
      sums[slot] += points[i].range_m * (border_rad - from_rad);
      from_rad = border_rad;
      ++slot;
    }
    sums[slot] += points[i].range_m * (to_rad - from_rad);
    from_rad = to_rad;
  }
  for (double& sum : sums) sum /= slot_rad;
  return sums;
}

/// Roughness of the ranges: root mean square of their second differences, 1 for pure noise on a straight run.
double roughness(const Point* points, std::size_t count, double range_sigma_m) {
  if (count < 3) return 1.0;
  double sum = 0.0;
  for (std::size_t i = 1; i + 1 < count; ++i) {
    sum += std::pow(points[i - 1].range_m - 2.0 * points[i].range_m + points[i + 1].range_m, 2);
  }
  return std::sqrt(sum / (6.0 * static_cast<double>(count - 2))) / range_sigma_m;
}

}  // namespace

SegmentEncoding encode(const Segments& segments, const Segment& segment, double range_sigma_m, double max_radius_m) {
  const Point* const points = &segments.points[segment.first];
  const std::size_t count = segment.count;
  // The object ends between its last hit and the next beam, so half a beam beyond the hit.
  const double right_rad = points[0].azimuth_rad - 0.5 * segments.resolution_rad;
  const double left_rad = points[count - 1].azimuth_rad + 0.5 * segments.resolution_rad;
  const double half_angle_rad = std::min(0.5 * (left_rad - right_rad), kMaxHalfAngleRad);

  SegmentEncoding result;
  result.azimuth_rad = 0.5 * (right_rad + left_rad);
  const std::array<double, SegmentEncoding::kSlots> ranges_m = profile(points, count, right_rad, left_rad);
  for (const double range_m : ranges_m) result.mean_range_m += range_m / static_cast<double>(ranges_m.size());
  result.half_width_m = result.mean_range_m * std::sin(half_angle_rad);

  const double w = result.half_width_m;
  for (std::size_t i = 0; i < ranges_m.size(); ++i) {
    result.inputs[i] = static_cast<float>((ranges_m[i] - result.mean_range_m) / w);
  }
  const double beams = (left_rad - right_rad) / segments.resolution_rad;
  const auto is_background = [](SegmentEnd end) { return end == SegmentEnd::kBackground ? 1.0 : 0.0; };
  // Beside few beams without a return the silhouette is at the last hit; beside many it may be anywhere.
  const auto is_hidden = [&](SegmentEnd end, double hidden_rad) {
    const bool lost = end == SegmentEnd::kNoReturn && hidden_rad > kFewBeams * segments.resolution_rad;
    return lost || !is_silhouette(end) ? 1.0 : 0.0;
  };
  const auto share = [&](SegmentEnd end, double hidden_rad) {
    return is_hidden(end, hidden_rad) * hidden_rad / (hidden_rad + left_rad - right_rad);
  };
  const std::array<double, SegmentEncoding::kScalars> scalars = {
      std::log(w / max_radius_m),
      std::log(range_sigma_m / w),
      std::log(std::sin(half_angle_rad)),
      std::log(beams),
      1.0 - std::min(static_cast<double>(count) / beams, 1.0),
      std::log(0.1 + roughness(points, count, range_sigma_m)),
      is_hidden(segment.right_end, segment.right_hidden_rad),
      is_background(segment.right_end),
      share(segment.right_end, segment.right_hidden_rad),
      is_hidden(segment.left_end, segment.left_hidden_rad),
      is_background(segment.left_end),
      share(segment.left_end, segment.left_hidden_rad),
  };
  for (std::size_t i = 0; i < scalars.size(); ++i) {
    result.inputs[SegmentEncoding::kSlots + i] = static_cast<float>(scalars[i]);
  }
  return result;
}

Vector5d to_segment_frame(const SegmentEncoding& encoding, const Ellipse& ellipse_level) {
  const Pose2 T_segment_level{-encoding.mean_range_m * Eigen::Vector2d::UnitX(), -encoding.azimuth_rad};
  return smooth_parameters(T_segment_level * ellipse_level);
}

Vector5d to_level_frame(const SegmentEncoding& encoding, const Vector5d& smooth_segment) {
  Vector5d result = smooth_segment;
  result(0) += encoding.mean_range_m;
  result.head<2>() = Eigen::Rotation2Dd(encoding.azimuth_rad) * result.head<2>();
  result.tail<2>() = Eigen::Rotation2Dd(2.0 * encoding.azimuth_rad) * result.tail<2>();
  return result;
}

}  // namespace situation_awareness

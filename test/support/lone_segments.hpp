// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cmath>
#include <vector>

#include "situation_awareness/common/random.hpp"
#include "situation_awareness/geometry/angles.hpp"
#include "situation_awareness/geometry/ellipse.hpp"
#include "situation_awareness/segments/segments.hpp"

namespace situation_awareness {

/// Azimuths of a scanner's beams in the level frame, by growing azimuth.
inline std::vector<double> level_scanner(double resolution_deg) {
  std::vector<double> azimuths_rad;
  for (int i = 0; - 135.0 + i * resolution_deg <= 135.0; ++i) {
    azimuths_rad.push_back(radians(-135.0 + i * resolution_deg));
  }
  return azimuths_rad;
}

/// The same scanner with its plane tilted about an axis 30 degrees off its x axis: its beams are unevenly spaced in the
/// level frame, as horizontal projection leaves them.
inline std::vector<double> tilted_scanner(double resolution_deg, double tilt_rad) {
  const double axis_rad = radians(30.0);
  std::vector<double> azimuths_rad = level_scanner(resolution_deg);
  for (double& azimuth_rad : azimuths_rad) {
    const double from_axis_rad = azimuth_rad - axis_rad;
    const double level_rad = std::atan2(std::sin(from_axis_rad) * std::cos(tilt_rad), std::cos(from_axis_rad));
    azimuth_rad += std::remainder(level_rad - from_axis_rad, 2.0 * kPi);
  }
  return azimuths_rad;
}

inline Segments empty_segments(const std::vector<double>& azimuths_rad) {
  Segments segments;
  segments.resolution_rad = (azimuths_rad.back() - azimuths_rad.front()) / static_cast<double>(azimuths_rad.size() - 1);
  return segments;
}

/// Append what a scanner sees of one ellipse alone, noiseless unless `random` is given. False if that is nothing.
inline bool append_segment(const Ellipse& ellipse, const std::vector<double>& azimuths_rad, Random* random,
                           Segments& segments) {
  Segment segment;
  segment.first = segments.points.size();
  for (std::size_t i = 0; i < azimuths_rad.size(); ++i) {
    const Eigen::Vector2d u(std::cos(azimuths_rad[i]), std::sin(azimuths_rad[i]));
    const auto range_m = intersect_ray(ellipse, Eigen::Vector2d::Zero(), u);
    if (!range_m) continue;
    Point point;
    point.azimuth_rad = azimuths_rad[i];
    point.range_m = *range_m + (random != nullptr ? 0.01 * random->normal() : 0.0);
    point.p_level_m = point.range_m * u;
    point.beam = static_cast<int>(i);
    point.state = BeamState::kHit;
    segments.points.push_back(point);
  }
  segment.count = segments.points.size() - segment.first;
  if (segment.count > 0) segments.segments.push_back(segment);
  return segment.count > 0;
}

/// One segment of the given points, which need not be ones that a scanner sees.
inline Segments lone_segment(const std::vector<Eigen::Vector2d>& points_m) {
  Segments segments;
  segments.resolution_rad = radians(0.25);
  for (const Eigen::Vector2d& point_m : points_m) {
    Point point;
    point.azimuth_rad = std::atan2(point_m.y(), point_m.x());
    point.range_m = point_m.norm();
    point.p_level_m = point_m;
    point.state = BeamState::kHit;
    segments.points.push_back(point);
  }
  segments.segments.resize(1);
  segments.segments[0].count = points_m.size();
  return segments;
}

}  // namespace situation_awareness

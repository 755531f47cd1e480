// SPDX-License-Identifier: BSD-3-Clause
#include "situation_awareness/path/segment_path.hpp"

#include <algorithm>
#include <cmath>
#include <variant>

#include "situation_awareness/geometry/angles.hpp"
#include "situation_awareness/geometry/vectors.hpp"

namespace situation_awareness {
namespace {

/// m. Shorter segments are none.
constexpr double kNothing_m = 1e-9;
/// rad. An arc counts as its chords over so much, from which it is 1 % of its radius away.
constexpr double kPartOfTurn_rad = 0.3;

DubinsSegment part_of_segment(const DubinsSegment& segment, double from_m, double to_m) {
  if (const Arc* arc = std::get_if<Arc>(&segment)) {
    const double sign = std::copysign(1.0, arc->sweep_rad);
    return Arc{arc->center_m, arc->radius_m, arc->from_rad + sign * from_m / arc->radius_m,
               sign * (to_m - from_m) / arc->radius_m};
  }
  const Straight& straight = *std::get_if<Straight>(&segment);
  const Eigen::Vector2d ahead(std::cos(straight.heading_rad), std::sin(straight.heading_rad));
  return Straight{straight.from_m + from_m * ahead, straight.from_m + to_m * ahead, straight.heading_rad};
}

}  // namespace

void clear(SegmentPath& path) {
  path.segments.clear();
  path.length_m = 0.0;
}

void append(SegmentPath& path, const DubinsSegment& segment) {
  const double segment_m = length_m(segment);
  if (segment_m < kNothing_m) return;
  path.segments.push_back(segment);
  path.length_m += segment_m;
}

void append(SegmentPath& path, const DubinsPath& dubins) {
  for (const DubinsSegment& segment : dubins.segments) append(path, segment);
}

void append_part(SegmentPath& path, const SegmentPath& from, double from_m, double to_m) {
  double begin_m = 0.0;
  for (int round = 0; round < 2 && begin_m < to_m; ++round) {
    for (const DubinsSegment& segment : from.segments) {
      const double segment_m = length_m(segment);
      const double low_m = std::max(from_m - begin_m, 0.0), high_m = std::min(to_m - begin_m, segment_m);
      if (low_m < high_m) append(path, part_of_segment(segment, low_m, high_m));
      begin_m += segment_m;
    }
  }
}

void cut(SegmentPath& path, double to_m) {
  double begin_m = 0.0;
  for (std::size_t i = 0; i < path.segments.size(); ++i) {
    const double segment_m = length_m(path.segments[i]);
    if (begin_m + segment_m > to_m) {
      const DubinsSegment segment = path.segments[i];
      path.segments.resize(i);
      path.length_m = begin_m;
      if (to_m > begin_m) append(path, part_of_segment(segment, 0.0, to_m - begin_m));
      return;
    }
    begin_m += segment_m;
  }
}

DubinsPlace place_at(const SegmentPath& path, double way_m) {
  return place_at(path.segments.data(), path.segments.data() + path.segments.size(), std::min(way_m, path.length_m));
}

int turns_around(const SegmentPath& closed, const Eigen::Vector2d& p_m) {
  double sum_rad = 0.0;
  for (const DubinsSegment& segment : closed.segments) {
    const double segment_m = length_m(segment);
    const Arc* arc = std::get_if<Arc>(&segment);
    const double parts = arc != nullptr ? std::ceil(std::abs(arc->sweep_rad) / kPartOfTurn_rad) : 1.0;
    Eigen::Vector2d from_m = place_at(&segment, &segment + 1, 0.0).pose.translation_m - p_m;
    for (double part = 1.0; part <= parts; part += 1.0) {
      const Eigen::Vector2d to_m = place_at(&segment, &segment + 1, segment_m * part / parts).pose.translation_m - p_m;
      sum_rad += std::atan2(cross(from_m, to_m), from_m.dot(to_m));
      from_m = to_m;
    }
  }
  return static_cast<int>(std::lround(sum_rad / (2.0 * kPi)));
}

double greatest_curvature_1_m(const SegmentPath& path) {
  double greatest_1_m = 0.0;
  for (const DubinsSegment& segment : path.segments) {
    if (const Arc* arc = std::get_if<Arc>(&segment)) greatest_1_m = std::max(greatest_1_m, 1.0 / arc->radius_m);
  }
  return greatest_1_m;
}

}  // namespace situation_awareness

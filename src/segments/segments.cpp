// SPDX-License-Identifier: BSD-3-Clause
#include "situation_awareness/segments/segments.hpp"

#include <algorithm>
#include <cmath>
#include <utility>

#include "situation_awareness/common/usual_room.hpp"
#include "situation_awareness/geometry/angles.hpp"

namespace situation_awareness {

const char* text_of(StructureReason reason) {
  switch (reason) {
    case StructureReason::kNone:
      break;
    case StructureReason::kExtent:
      return "structure: larger than an object";
    case StructureReason::kInnerCorner:
      return "structure: inner corner";
    case StructureReason::kStraightHidden:
      return "structure: straight, an end hidden";
    case StructureReason::kFlat:
      return "structure: flat";
    case StructureReason::kInLine:
      return "structure: in line with another";
  }
  return "";
}

const char* text_of(RunRefusal refusal) {
  return refusal == RunRefusal::kTooFewPoints ? "segment refused: too few points"
                                              : "segment refused: out of range or volume";
}

Eigen::Vector2d middle_level_m(const Segments& segments, const Segment& segment) {
  Eigen::Vector2d sum_m = Eigen::Vector2d::Zero();
  for (std::size_t i = segment.first; i < segment.first + segment.count; ++i) sum_m += segments.points[i].p_level_m;
  return sum_m / static_cast<double>(segment.count);
}

double middle_s(const Segments& segments, const Segment& segment) {
  double sum = 0.0;
  for (std::size_t i = segment.first; i < segment.first + segment.count; ++i) sum += segments.points[i].beam;
  return sum / static_cast<double>(segment.count) * segments.time_increment_s;
}

std::vector<Overlap> overlaps_of(const Segments& segments, const std::vector<ExpectedOutline>& ellipses_level,
                                 std::vector<Overlap> memory) {
  std::vector<Overlap> result = std::move(memory);
  result.clear();
  result.reserve(kUsualRoom);
  if (segments.segments.empty()) return result;
  const auto first_rad = [&](const Segment& s) { return segments.points[s.first].azimuth_rad; };
  const auto last_rad = [&](const Segment& s) { return segments.points[s.first + s.count - 1].azimuth_rad; };
  for (std::size_t k = 0; k < ellipses_level.size(); ++k) {
    const Ellipse& ellipse = ellipses_level[k].ellipse;
    const double distance_m = ellipse.center_m.norm();
    const double reach_m = std::max(ellipse.rx_m, ellipse.ry_m);
    if (distance_m <= reach_m) continue;
    const double half_rad = std::asin(reach_m / distance_m);
    const double wrapped_rad = std::atan2(ellipse.center_m.y(), ellipse.center_m.x());
    for (const double azimuth_rad : {wrapped_rad - 2.0 * kPi, wrapped_rad, wrapped_rad + 2.0 * kPi}) {
      auto segment = std::lower_bound(segments.segments.begin(), segments.segments.end(), azimuth_rad - half_rad,
                                      [&](const Segment& s, double low_rad) { return last_rad(s) < low_rad; });
      for (; segment != segments.segments.end() && first_rad(*segment) <= azimuth_rad + half_rad; ++segment) {
        result.push_back({static_cast<std::size_t>(segment - segments.segments.begin()), k});
      }
    }
  }
  std::sort(result.begin(), result.end(), [](const Overlap& a, const Overlap& b) {
    return std::make_pair(a.segment, a.ellipse) < std::make_pair(b.segment, b.ellipse);
  });
  return result;
}

}  // namespace situation_awareness

// SPDX-License-Identifier: BSD-3-Clause
#include "situation_awareness/points/points.hpp"

#include <utility>

namespace situation_awareness {
namespace {

float clear_m(const Point& point) {
  switch (point.state) {
    case BeamState::kHit:
    case BeamState::kOutside:
    case BeamState::kFree:
      return static_cast<float>(point.range_m);
    case BeamState::kTooClose:
    case BeamState::kInvalid:
      break;
  }
  return 0.0F;
}

}  // namespace

FreeSpace free_space(const Points& points, FreeSpace memory) {
  FreeSpace result = std::move(memory);
  result.azimuth_rad.clear();
  result.range_m.clear();
  result.full_circle = points.full_circle;
  result.azimuth_rad.reserve(points.points.size());
  result.range_m.reserve(points.points.size());
  for (const Point& point : points.points) {
    result.azimuth_rad.push_back(static_cast<float>(point.azimuth_rad));
    result.range_m.push_back(clear_m(point));
  }
  return result;
}

}  // namespace situation_awareness

// SPDX-License-Identifier: BSD-3-Clause
#include "situation_awareness/points/point_states.hpp"

#include <algorithm>
#include <array>
#include <cstdio>

namespace situation_awareness {

void PointStates::add(const Points& points) {
  ++scans_;
  for (const Point& point : points.points) {
    switch (point.state) {
      case BeamState::kHit:
        ++hits_;
        break;
      case BeamState::kOutside:
        ++outside_;
        nearest_m_ = std::min(nearest_m_, point.range_m);
        farthest_m_ = std::max(farthest_m_, point.range_m);
        break;
      case BeamState::kFree:
        ++free_;
        break;
      case BeamState::kTooClose:
        ++too_close_;
        break;
      case BeamState::kInvalid:
        ++invalid_;
        break;
    }
  }
}

std::string PointStates::why_no_hit() const {
  if (scans_ == 0 || hits_ > 0) return "";
  std::array<char, 320> text{};
  const auto count = [](std::uint64_t number) { return static_cast<unsigned long long>(number); };
  if (outside_ > 0) {
    std::snprintf(text.data(), text.size(),
                  "no hit of %llu scans is of interest: all %llu, %.2f to %.2f m away, are beyond scan/max_range_m or "
                  "outside scan/volume",
                  count(scans_), count(outside_), nearest_m_, farthest_m_);
  } else {
    std::snprintf(text.data(), text.size(),
                  "no beam of %llu scans hit anything: %llu say that there is nothing up to range_max, %llu that it is "
                  "too close, below range_min or scan/min_range_m, and %llu are no range (NaN, 0, or below range_min)",
                  count(scans_), count(free_), count(too_close_), count(invalid_));
  }
  return text.data();
}

}  // namespace situation_awareness

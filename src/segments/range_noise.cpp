// SPDX-License-Identifier: BSD-3-Clause
#include "situation_awareness/segments/range_noise.hpp"

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <cstdlib>

namespace situation_awareness {
namespace {

constexpr std::size_t kEnough = 50;  // differences
/// Median of the absolute value of a normal variable.
constexpr double kNormalMedian = 0.6745;
/// Factor on the standard deviation of r - 3 r' + 3 r'' - r'''.
const double kThirdDifference = std::sqrt(20.0);

}  // namespace

double RangeNoise::sigma_m(const Segments& segments) {
  differences_m_.clear();
  for (const Segment& segment : segments.segments) {
    const Point* const p = &segments.points[segment.first];
    for (std::size_t i = 0; i + 3 < segment.count; ++i) {
      if (std::abs(p[i + 3].beam - p[i].beam) != 3) continue;
      differences_m_.push_back(std::abs(p[i].range_m - p[i + 3].range_m + 3.0 * (p[i + 2].range_m - p[i + 1].range_m)));
    }
  }
  if (differences_m_.size() < kEnough) return 0.0;
  const auto middle = differences_m_.begin() + static_cast<std::ptrdiff_t>(differences_m_.size() / 2);
  std::nth_element(differences_m_.begin(), middle, differences_m_.end());
  return *middle / (kNormalMedian * kThirdDifference);
}

}  // namespace situation_awareness

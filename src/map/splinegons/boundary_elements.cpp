// SPDX-License-Identifier: BSD-3-Clause
#include "boundary_elements.hpp"

#include <algorithm>
#include <cmath>

#include "situation_awareness/geometry/vectors.hpp"

namespace situation_awareness {
namespace {

// Where no source is named, none is recorded; the sensitivity of these was not measured.

/// Elements and length in m of a boundary, at least.
constexpr std::size_t kFewestElements = 6;
constexpr double kShortest_m = 0.2;
/// Standard deviations, beyond the elements' spacing, by which an element is off its neighbours' lines that is left
/// out.
constexpr double kOutlierSigmas = 6.0;
/// Median of the absolute value of a standard normal variable.
constexpr double kMedianSigmas = 0.6745;
/// m, and spacings of the elements. Boundary without elements that is a gap, where no main vertices are.
constexpr double kGap_m = 0.8;
constexpr double kGapSpacings = 4.0;

}  // namespace

bool BoundaryElements::take(const std::vector<SplinegonElement>& elements) {
  const std::size_t n = elements.size();
  if (n < kFewestElements) return false;
  origin_m = elements[0].p_world_m;
  const auto median = [&] {
    const auto middle = scratch_.begin() + static_cast<std::ptrdiff_t>(scratch_.size() / 2);
    std::nth_element(scratch_.begin(), middle, scratch_.end());
    return *middle;
  };
  scratch_.clear();
  for (std::size_t i = 1; i < n; ++i) {
    scratch_.push_back((elements[i].p_world_m - elements[i - 1].p_world_m).norm());
  }
  const double spacing_m = median();
  points_m.clear();
  normals.clear();
  weights.clear();
  scratch_.clear();
  for (std::size_t i = 0; i < n; ++i) {
    // An element is an outlier if it is far from at least two thirds of the lines through one of three neighbours
    // before and one of three after it. At a corner, all lines are about a spacing away.
    const double sigma_m = std::sqrt(elements[i].variance_m2);
    const double most_m = kOutlierSigmas * sigma_m + spacing_m;
    const std::size_t most_before = closed ? 3 : std::min<std::size_t>(i, 3);
    const std::size_t most_after = closed ? 3 : std::min<std::size_t>(n - 1 - i, 3);
    const std::size_t lines = most_before * most_after;
    std::size_t near = 0;
    for (std::size_t before = 1; before <= most_before; ++before) {
      const Eigen::Vector2d& from = elements[i >= before ? i - before : i + n - before].p_world_m;
      for (std::size_t after = 1; after <= most_after && near <= lines / 3; ++after) {
        const Eigen::Vector2d line = elements[i + after < n ? i + after : i + after - n].p_world_m - from;
        const double across_m = std::abs(left_of(line).dot(elements[i].p_world_m - from)) / std::max(line.norm(), 1e-9);
        if (before == 1 && after == 1) scratch_.push_back(across_m / sigma_m);
        if (!(across_m > most_m)) ++near;
      }
    }
    if (lines > 0 && near <= lines / 3) continue;
    points_m.push_back(elements[i].p_world_m - origin_m);
    normals.push_back(elements[i].normal_world);
    weights.push_back(1.0 / sigma_m);
  }
  if (points_m.size() < kFewestElements) return false;
  // The distance from the line through both neighbours has 1.5 times the variance of an element.
  const double raised = std::max(1.0, scratch_.empty() ? 1.0 : median() / (kMedianSigmas * std::sqrt(1.5)));
  for (double& weight : weights) weight /= raised;
  s_m.clear();
  gaps.clear();
  double along_m = 0.0;
  for (std::size_t i = 0; i < points_m.size(); ++i) {
    if (i > 0) along_m += (points_m[i] - points_m[i - 1]).norm();
    s_m.push_back(along_m);
    const std::size_t next = i + 1 < points_m.size() ? i + 1 : 0;
    const double edge_m = (points_m[next] - points_m[i]).norm();
    if ((closed || next > 0) && edge_m > std::max(kGap_m, kGapSpacings * spacing_m)) gaps.push_back({i, next});
  }
  perimeter_m = along_m + (closed ? (points_m.front() - points_m.back()).norm() : 0.0);
  return perimeter_m > kShortest_m;
}

double BoundaryElements::way_m(std::size_t from, std::size_t to) const {
  return to >= from ? s_m[to] - s_m[from] : s_m[to] + perimeter_m - s_m[from];
}

}  // namespace situation_awareness

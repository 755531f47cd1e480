// SPDX-License-Identifier: BSD-3-Clause
#include "expected_jumps.hpp"

#include <algorithm>
#include <cmath>

#include "circle_sums.hpp"
#include "residual_bounds.hpp"
#include "situation_awareness/geometry/vectors.hpp"

namespace situation_awareness {
namespace {

// Where no source is named, none is recorded; the sensitivity of these was not measured.

/// m. Effect on the boundary of a jump of the curvature that is expected anywhere.
constexpr double kLeastJumpEffect_m = 0.001;
/// Largest distance of a biarc from a curve with linear curvature and the same ends, over jump * length^2:
/// docs/math/splinegons.md.
constexpr double kJumpEffect = 1.0 / 216.0;
/// Square of an expected jump over that of the fit, which is in part noise: from 0.2 to 1 errors change by a tenth.
constexpr double kJumpShare = 0.3;
/// Standard deviations of chi^2 by which one arc may be worse than many.
constexpr double kOneArcSigmas = 2.0;

}  // namespace

void ExpectedJumps::expect(bool first) {
  const std::size_t count = chain_.arcs.size();
  sigma_1pm_.resize(count);
  const auto before = [&](std::size_t j) { return j > 0 ? j - 1 : count - 1; };
  const auto least = [&](std::size_t j) {
    const double length_m = chain_.arcs[j].length_m + chain_.arcs[before(j)].length_m;
    return kLeastJumpEffect_m / (kJumpEffect * length_m * length_m);
  };
  for (std::size_t j = 0; j < count; ++j) {
    if (first) {
      sigma_1pm_[j] = 2.0 / (chain_.arcs[j].length_m + chain_.arcs[before(j)].length_m);
      continue;
    }
    double sum = 0.0, number = 0.0;
    for (const std::size_t other : {before(j), j, j + 1 < count ? j + 1 : 0}) {
      if (!chain_.is_smooth(other)) continue;
      const double jump = chain_.arcs[other].curvature_1pm - chain_.arcs[before(other)].curvature_1pm;
      sum += jump * jump;
      number += 1.0;
    }
    sigma_1pm_[j] = std::sqrt(kJumpShare * sum / std::max(number, 1.0) + least(j) * least(j));
  }
  chain_.compute_residuals(elements_);
  if (first) return;
  first_of_.assign(count, elements_.points_m.size());
  last_of_.assign(count, 0);
  for (std::size_t i = 0; i < elements_.points_m.size(); ++i) {
    first_of_[chain_.arc_of[i]] = std::min(first_of_[chain_.arc_of[i]], i);
    last_of_[chain_.arc_of[i]] = i;
  }
  parameters_ = elements_.closed ? 0.0 : 2.0;
  for (const BiarcChain::Node& node : chain_.nodes) parameters_ += node.corner ? 2.0 : 0.0;
  // Pieces begin at corners, else at the first arc.
  std::size_t start = 0;
  while (start < count && chain_.is_smooth(start)) ++start;
  if (start == count) start = 0;
  for (std::size_t done = 0; done < count;) {
    const std::size_t begin = (start + done) % count;
    std::size_t arcs = 1;
    while (done + arcs < count && chain_.is_smooth((begin + arcs) % count)) ++arcs;
    if (is_one_arc(begin, arcs)) {
      parameters_ += start == begin && arcs == count && chain_.is_smooth(begin) ? 3.0 : 1.0;
      for (std::size_t a = 0; a < arcs; ++a) sigma_1pm_[(begin + a) % count] = 0.01 * least((begin + a) % count);
    } else {
      parameters_ += static_cast<double>(arcs);
    }
    done += arcs;
  }
}

/// Whether one arc meets the elements of a number of arcs, which is a piece between corners or ends or all of a closed
/// boundary, as well as the fit does, but for what its more parameters take from noise.
bool ExpectedJumps::is_one_arc(std::size_t begin, std::size_t arcs) const {
  const std::size_t count = chain_.arcs.size();
  const bool ring = elements_.closed && arcs == count && chain_.is_smooth(begin);
  const auto is_in = [&](std::size_t i) {
    return (chain_.arc_of[i] >= begin ? chain_.arc_of[i] - begin : chain_.arc_of[i] + count - begin) < arcs;
  };
  // A ring has x^2 + y^2 = c0 + c1 x + c2 y; both are circles.
  const BiarcChain::Node& from = chain_.nodes[begin / 2];
  const Eigen::Vector2d way_m = chain_.nodes[(begin + arcs) / 2 % chain_.nodes.size()].p_m - from.p_m;
  const Eigen::Vector2d axis = ring || way_m.norm() < 1e-6 ? Eigen::Vector2d(1.0, 0.0) : way_m.normalized();
  const auto local = [&](std::size_t i) -> Eigen::Vector2d {
    const Eigen::Vector2d v = elements_.points_m[i] - from.p_m;
    return {axis.dot(v), left_of(axis).dot(v)};
  };
  std::size_t first = elements_.points_m.size(), last = 0;
  for (std::size_t a = 0; a < arcs; ++a) {
    first = std::min(first, first_of_[(begin + a) % count]);
    last = std::max(last, last_of_[(begin + a) % count]);
  }
  CircleSums sums;
  std::size_t elements = 0;
  double fit_chi2 = 0.0;
  for (std::size_t i = first; i <= last && i < elements_.points_m.size(); ++i) {
    if (!is_in(i)) continue;
    const Eigen::Vector2d p = local(i);
    const double sigmas = std::abs(chain_.of_elements[i].distance_m) * elements_.weights[i];
    const double weight =
        elements_.weights[i] * elements_.weights[i] * std::min(1.0, kHuberSigmas / std::max(sigmas, 1e-12));
    if (ring) {
      sums.add({1.0, p.x(), p.y()}, p.squaredNorm(), weight);
    } else {
      sums.add(p, weight);
    }
    fit_chi2 += std::min(sigmas * sigmas, kMostChi2);
    ++elements;
  }
  if (elements < 4) return false;
  const Eigen::Vector3d c = sums.solve();
  double arc_chi2 = 0.0;
  for (std::size_t i = first; i <= last; ++i) {
    if (!is_in(i)) continue;
    const Eigen::Vector2d p = local(i);
    const double e = ring ? p.squaredNorm() - c(0) - c(1) * p.x() - c(2) * p.y() : circle_offset(c, p);
    const Eigen::Vector2d gradient =
        ring ? Eigen::Vector2d(2.0 * p.x() - c(1), 2.0 * p.y() - c(2)) : circle_gradient(c, p);
    arc_chi2 += std::min(elements_.weights[i] * elements_.weights[i] * e * e / std::max(gradient.squaredNorm(), 0.01),
                         kMostChi2);
  }
  const double parameters = std::min(static_cast<double>(arcs) + (ring ? 0.0 : 2.0), static_cast<double>(elements));
  const double more = std::max(parameters - 3.0, 1.0);
  return arc_chi2 < fit_chi2 + more + kOneArcSigmas * std::sqrt(2.0 * more);
}

}  // namespace situation_awareness

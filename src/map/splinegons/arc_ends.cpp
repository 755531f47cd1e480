// SPDX-License-Identifier: BSD-3-Clause
#include "arc_ends.hpp"

#include <algorithm>
#include <cmath>
#include <cstddef>

#include "circle_sums.hpp"
#include "residual_bounds.hpp"
#include "situation_awareness/geometry/vectors.hpp"

namespace situation_awareness {
namespace {

/// Whether one arc meets the elements from one to before another, which may be beyond the last.
bool is_arc(const BoundaryElements& elements, std::size_t begin, std::size_t end) {
  const std::size_t n = elements.points_m.size();
  const Eigen::Vector2d from_m = elements.points_m[begin % n], way_m = elements.points_m[(end - 1) % n] - from_m;
  const double chord_m = way_m.norm();
  if (chord_m < 1e-9) return false;
  const Eigen::Vector2d axis = way_m / chord_m;
  Eigen::Vector3d c = Eigen::Vector3d::Zero();
  const auto distance_m = [&](const Eigen::Vector2d& p) {
    return circle_offset(c, p) / std::max(circle_gradient(c, p).norm(), 0.3);
  };
  const auto local = [&](std::size_t i) -> Eigen::Vector2d {
    const Eigen::Vector2d v = elements.points_m[i % n] - from_m;
    return {axis.dot(v), left_of(axis).dot(v)};
  };
  for (int round = 0; round < 2; ++round) {
    CircleSums sums;
    for (std::size_t i = begin; i < end; ++i) {
      const Eigen::Vector2d p = local(i);
      double weight = elements.weights[i % n] * elements.weights[i % n];
      if (round > 0) {
        const double sigmas = std::abs(distance_m(p)) * elements.weights[i % n];
        weight *= std::min(1.0, kHuberSigmas / std::max(sigmas, 1e-12));
      }
      sums.add(p, weight);
    }
    c = sums.solve();
    if (!c.allFinite()) return false;
  }
  double products = 0.0, weights = 0.0, before = 0.0;
  for (std::size_t i = begin; i < end; ++i) {
    const double weight = misfit_weight(elements.weights[i % n]);
    const double sigmas = std::clamp(distance_m(local(i)) * weight, -kMostSigmas, kMostSigmas);
    products += sigmas * before;
    weights += weight;
    before = sigmas;
  }
  return !have_misfit_in_common(products, static_cast<double>(end - begin), weights);
}

}  // namespace

void find_arc_ends(const BoundaryElements& elements, const std::vector<BoundaryCorner>& corners,
                   std::vector<Station>& arc_ends) {
  const std::size_t n = elements.points_m.size();
  arc_ends.clear();
  const auto add_piece = [&](std::size_t begin, std::size_t end) {
    for (std::size_t from = begin; from < end;) {
      std::size_t sure = std::min(from + BoundaryElements::kElementsOfVertex, end), wrong = end + 1;
      for (std::size_t step = BoundaryElements::kElementsOfVertex; sure < end && wrong > end; step *= 2) {
        const std::size_t next = std::min(sure + step, end);
        (is_arc(elements, from, next) ? sure : wrong) = next;
      }
      while (wrong <= end && wrong - sure > 1) {
        const std::size_t middle = sure + (wrong - sure) / 2;
        (is_arc(elements, from, middle) ? sure : wrong) = middle;
      }
      from = sure;
      if (end - from < BoundaryElements::kElementsOfVertex) break;  // too few for one of their own
      const double s_m =
          0.5 * (elements.s_m[(from + n - 1) % n] + (from % n > 0 ? elements.s_m[from % n] : elements.perimeter_m));
      arc_ends.push_back({s_m, Station::kNoCorner});
    }
  };
  const auto first_at = [&](double s_m) {
    return static_cast<std::size_t>(std::lower_bound(elements.s_m.begin(), elements.s_m.end(), s_m) -
                                    elements.s_m.begin());
  };
  if (corners.empty()) {
    if (elements.closed) arc_ends.push_back({0.0, Station::kNoCorner});
    add_piece(0, n);
    return;
  }
  if (!elements.closed) add_piece(0, first_at(corners.front().s_m));
  for (std::size_t c = 0; c < corners.size(); ++c) {
    arc_ends.push_back({corners[c].s_m, c});
    const bool is_last = c + 1 == corners.size();
    if (is_last && !elements.closed) {
      add_piece(first_at(corners[c].s_m), n);
    } else {
      add_piece(first_at(corners[c].s_m), is_last ? n + first_at(corners.front().s_m) : first_at(corners[c + 1].s_m));
    }
  }
  std::sort(arc_ends.begin(), arc_ends.end(), [](const Station& a, const Station& b) { return a.s_m < b.s_m; });
}

}  // namespace situation_awareness

// SPDX-License-Identifier: BSD-3-Clause
#include "polygon_parts.hpp"

#include <cmath>

#include "situation_awareness/geometry/vectors.hpp"

namespace situation_awareness {
namespace {

// Where no source is named, none is recorded; the sensitivity of these was not measured.

/// m. Least length of an edge of a polygon.
constexpr double kShortestEdge_m = 1e-4;
/// Least offset (m) of an element from the polygon that is taken for its neighbours, where arcs do not follow them.
constexpr double kPolygonOffset_m = 0.02;
/// A biarc goes astray if it is longer than the polygon by this factor, or one of its arcs turns by this (rad).
constexpr double kMostWay = 1.3, kMostTurn_rad = 2.5;
/// So does a corner that is farther from one of the elements beside it than these are from each other, by this factor.
constexpr double kMostCornerWay = 1.5;

}  // namespace

void PolygonParts::find() {
  sum_residuals(elements_, chain_, residuals_);
  find_misfits();
  do {
    spread();
  } while (!cut_beside());
}

/// The biarcs that do not follow their elements, or go astray between them.
void PolygonParts::find_misfits() {
  is_polygon_.assign(chain_.biarcs(), false);
  std::size_t before = elements_.points_m.size() - 1;  // the last element so far
  for (std::size_t k = 0; k < chain_.biarcs(); ++k) {
    const BiarcResiduals& sums = residuals_[k];
    const BiarcChain::Arc& first = chain_.arcs[2 * k];
    const BiarcChain::Arc& second = chain_.arcs[2 * k + 1];
    // A corner is between the elements beside it.
    const std::size_t n = elements_.points_m.size();
    const std::size_t after = residuals_[k].elements > 0.0 ? first_element(k) : (before + 1) % n;
    if (elements_.follow_tips && chain_.nodes[k].corner && (elements_.closed || k > 0) && after != before) {
      const Eigen::Vector2d& from_m = elements_.points_m[(after + n - 1) % n];
      const Eigen::Vector2d& to_m = elements_.points_m[after];
      const double most_m = kMostCornerWay * (to_m - from_m).norm() + kPolygonOffset_m;
      if ((chain_.nodes[k].p_m - from_m).norm() > most_m || (chain_.nodes[k].p_m - to_m).norm() > most_m) {
        is_polygon_[k] = is_polygon_[(k + chain_.biarcs() - 1) % chain_.biarcs()] = true;
      }
    }
    // Along the elements, from that before to that after.
    double along_m = (chain_.nodes[chain_.next_node(k)].p_m - chain_.nodes[k].p_m).norm();
    const auto elements = static_cast<std::size_t>(sums.elements);
    const auto edge_m = [&](std::size_t at) {
      return (elements_.points_m[(at + 1) % n] - elements_.points_m[at]).norm();
    };
    if (elements == 0 && (elements_.closed || before + 1 < n)) along_m = edge_m(before) + BiarcChain::kNear_m;
    if (elements > 0 && elements < n) {
      const std::size_t from = first_element(k), to = (from + elements - 1) % n;
      before = to;
      along_m = elements_.way_m(from, to) + BiarcChain::kNear_m;
      if (elements_.closed || from > 0) along_m += edge_m((from + n - 1) % n);
      if (elements_.closed || to + 1 < n) along_m += edge_m(to);
    }
    const auto turn_rad = [](const BiarcChain::Arc& arc) { return std::abs(arc.curvature_1pm * arc.length_m); };
    const bool is_sound = first.length_m + second.length_m < kMostWay * along_m && turn_rad(first) < kMostTurn_rad &&
                          turn_rad(second) < kMostTurn_rad && first.length_m > BiarcChain::kShortestArc_m &&
                          second.length_m > BiarcChain::kShortestArc_m;
    is_polygon_[k] = is_polygon_[k] || !is_sound || is_misfit(sums);
  }
}

/// Beside a polygon a few elements are of it: a biarc of theirs has nothing else to hold it.
void PolygonParts::spread() {
  for (std::size_t step = 0; elements_.follow_tips && step < 4 * chain_.biarcs(); ++step) {
    const std::size_t k = (step < 2 * chain_.biarcs() ? step : 4 * chain_.biarcs() - 1 - step) % chain_.biarcs();
    if (residuals_[k].elements >= static_cast<double>(BoundaryElements::kElementsOfArc)) continue;
    is_polygon_[k] = is_polygon_[k] ||
                     ((elements_.closed || k > 0) && is_polygon_[(k + chain_.biarcs() - 1) % chain_.biarcs()]) ||
                     ((elements_.closed || k + 1 < chain_.biarcs()) && is_polygon_[chain_.next_node(k)]);
  }
}

/// Index of a biarc's first element, whose others follow.
std::size_t PolygonParts::first_element(std::size_t biarc) const {
  const BiarcResiduals& sums = residuals_[biarc];
  if (!elements_.closed || sums.first > 0 || static_cast<double>(sums.last + 1) <= sums.elements) return sums.first;
  std::size_t first = elements_.points_m.size();
  while (first > 1 && chain_.arc_of[first - 1] / 2 == biarc) --first;
  return first % elements_.points_m.size();
}

/// The elements of some biarcs in a row.
PolygonParts::Run PolygonParts::elements_of(std::size_t biarc, std::size_t count) const {
  Run run;
  for (std::size_t k = 0; k < count; ++k) {
    const std::size_t of = (biarc + k) % chain_.biarcs();
    if (residuals_[of].elements == 0.0) continue;
    if (run.elements == 0) run.first = first_element(of);
    run.elements += static_cast<std::size_t>(residuals_[of].elements);
  }
  return run;
}

Eigen::Vector2d PolygonParts::begin_of(std::size_t biarc) const {
  const BiarcChain::Arc& first = chain_.arcs[2 * biarc];
  if (cut_m_[2 * biarc] == 0.0) return chain_.nodes[biarc].p_m;
  return point_on(first, cut_m_[2 * biarc]);
}

Eigen::Vector2d PolygonParts::end_of(std::size_t biarc) const {
  const BiarcChain::Arc& second = chain_.arcs[2 * biarc + 1];
  if (cut_m_[2 * biarc + 1] == 0.0) return chain_.nodes[chain_.next_node(biarc)].p_m;
  return point_on(second, second.length_m - cut_m_[2 * biarc + 1]);
}

/// A biarc beside a polygon begins or ends where the polygon does: what lies beyond is cut off, else the boundary would
/// go there and back. False where all of an arc would be: then its biarc is of the polygon, and others may be.
bool PolygonParts::cut_beside() {
  const std::size_t count = chain_.biarcs();
  cut_m_.assign(chain_.arcs.size(), 0.0);
  bool is_done = true;
  for (std::size_t k = 0; k < count; ++k) {
    const std::size_t before = (k + count - 1) % count;
    if (!is_polygon_[k] || ((elements_.closed || k > 0) && is_polygon_[before])) continue;  // no begin of a polygon
    std::size_t run = 1;
    while (run < count && (elements_.closed || k + run < count) && is_polygon_[(k + run) % count]) ++run;
    if (run == count) continue;
    const Run elements = elements_of(k, run);
    const std::size_t after = (k + run) % count, n = elements_.points_m.size();
    const auto cut = [&](std::size_t arc, double beyond_m) {
      if (beyond_m <= 0.0) return;
      cut_m_[arc] = beyond_m;
      if (chain_.arcs[arc].length_m - beyond_m > kShortestEdge_m) return;
      is_polygon_[arc / 2] = true;
      is_done = false;
    };
    if (elements_.closed || k > 0) {
      const std::size_t arc = 2 * before + 1;
      const Eigen::Vector2d& first_m =
          elements.elements > 0 ? elements_.points_m[elements.first] : chain_.nodes[after].p_m;
      cut(arc, chain_.arcs[arc].length_m - chain_.way_to_foot_m(first_m, arc));
    }
    if (elements_.closed || k + run < count) {
      const Eigen::Vector2d& last_m = elements.elements > 0
                                          ? elements_.points_m[(elements.first + elements.elements - 1) % n]
                                          : chain_.nodes[k].p_m;
      cut(2 * after, chain_.way_to_foot_m(last_m, 2 * after));
    }
  }
  return is_done;
}

void PolygonParts::append(std::size_t biarc, std::size_t count, std::vector<SplinegonVertex>& vertices) {
  corners_m_.clear();
  const bool is_begin = !elements_.closed && biarc == 0, is_end = !elements_.closed && biarc + count == chain_.biarcs();
  const bool is_whole = elements_.closed && count == chain_.biarcs();
  const auto add = [&](const Eigen::Vector2d& p_m, double sigma_m) {
    if (corners_m_.empty() || (p_m - corners_m_.back().p_m).norm() > kShortestEdge_m) {
      corners_m_.push_back({p_m, sigma_m});
    }
  };
  const double node_m = vertices.empty() ? kPolygonOffset_m : vertices.back().sigma_m;
  if (!is_begin && !is_whole) add(end_of((biarc + chain_.biarcs() - 1) % chain_.biarcs()), node_m);
  const Run run = elements_of(biarc, count);
  for (std::size_t i = 0; i < run.elements; ++i) {
    const std::size_t element = (run.first + i) % elements_.points_m.size();
    add(elements_.points_m[element], 1.0 / elements_.weights[element]);
  }
  if (!is_end && !is_whole) {
    const Eigen::Vector2d end_m = begin_of((biarc + count) % chain_.biarcs());
    while (!corners_m_.empty() && (end_m - corners_m_.back().p_m).norm() <= kShortestEdge_m) corners_m_.pop_back();
    add(end_m, kPolygonOffset_m);
  }
  if (!is_begin && !is_whole) vertices.pop_back();
  append_corners(is_end, is_whole, vertices);
}

void PolygonParts::append_corners(bool is_end, bool is_whole, std::vector<SplinegonVertex>& vertices) {
  if (corners_m_.size() < 2) return;
  kept_.assign(1, 0);
  simplification_.add(
      0, corners_m_.size() - 1, kPolygonOffset_m, [&](std::size_t i) { return corners_m_[i].p_m; },
      [&](std::size_t i) { return corners_m_[i].sigma_m; }, kept_);
  for (std::size_t k = 0; k < kept_.size(); ++k) {
    const PolygonCorner& corner = corners_m_[kept_[k]];
    const bool is_last = k + 1 == kept_.size();
    if (is_last && !is_end && !is_whole) break;
    const double variance_m2 = corner.sigma_m * corner.sigma_m + kPolygonOffset_m * kPolygonOffset_m;
    vertices.push_back({corner.p_m + elements_.origin_m, 0.0, std::sqrt(variance_m2), true});
    if (is_last && is_end) break;
    const Eigen::Vector2d to_m = corners_m_[kept_[is_last ? 0 : k + 1]].p_m;
    vertices.push_back({0.5 * (corner.p_m + to_m) + elements_.origin_m, 0.0, std::sqrt(variance_m2), false});
  }
}

}  // namespace situation_awareness

// SPDX-License-Identifier: BSD-3-Clause
#include "main_vertices.hpp"

#include <algorithm>
#include <cmath>

#include "arc_ends.hpp"
#include "directions.hpp"
#include "line_sums.hpp"
#include "situation_awareness/geometry/angles.hpp"
#include "situation_awareness/geometry/vectors.hpp"

namespace situation_awareness {
namespace {

// Where no source is named, none is recorded; the sensitivity of these was not measured.

/// m. Least mean distance of main vertices of an open boundary: a short one has fewer.
constexpr double kLeastSpacing_m = 0.8;
/// Largest distance of main vertices along the boundary, over their mean distance.
constexpr double kSpacingRatio = 2.5;
/// Main vertices of a closed boundary, at least.
constexpr std::size_t kFewestOfClosed = 4;
/// Density of main vertices in gaps.
constexpr double kGapShare = 1e-3;
/// Into so many a biarc is parted that does not follow the boundary, at most.
constexpr double kMostParts = 4.0;

/// Where the fit hardly breaks there is no corner.
bool is_break(const BiarcChain::Node& node) {
  const double break_rad = wrap_to_pi(node.yaw_out_rad - node.yaw_in_rad);
  return node.corner && std::abs(break_rad) > BoundaryCorner::kLeastBreak * BoundaryCorner::kAngle_rad;
}

}  // namespace

std::size_t MainVertices::wanted_nodes() const {
  const std::size_t determined = elements_.points_m.size() / BoundaryElements::kElementsOfVertex;
  if (elements_.closed) return std::clamp<std::size_t>(determined, kFewestOfClosed, most_);
  const auto fitting = static_cast<std::size_t>(std::lround(elements_.perimeter_m / kLeastSpacing_m)) + 1;
  return std::clamp<std::size_t>(std::min(fitting, determined), 2, most_);
}

void MainVertices::place_on_elements() {
  const std::size_t n = elements_.points_m.size();
  const std::size_t count = wanted_nodes();
  find_arc_ends(elements_, corners_, arc_ends_);
  stations_.clear();
  if (arc_ends_.size() + (elements_.closed ? 0 : 2) > count) {
    if (!elements_.closed) stations_.push_back({0.0, Station::kNoCorner});
    stations_.insert(stations_.end(), arc_ends_.begin(), arc_ends_.end());
    if (!elements_.closed) stations_.push_back({elements_.perimeter_m, Station::kNoCorner});
  } else {
    shares_.cell_s_m.assign(1, 0.0);
    shares_.share.clear();
    const auto add_cell = [&](double end_m, double share) {
      if (end_m <= shares_.cell_s_m.back()) return;
      shares_.cell_s_m.push_back(end_m);
      shares_.share.push_back(share);
    };
    for (const BoundaryElements::Gap& gap : elements_.gaps) {
      add_cell(elements_.s_m[gap.last], 1.0);
      add_cell(gap.next > 0 ? elements_.s_m[gap.next] : elements_.perimeter_m, kGapShare);
    }
    add_cell(elements_.perimeter_m, 1.0);
    for (std::size_t c = 0; c < corners_.size(); ++c) stations_.push_back({corners_[c].s_m, c});
    shares_.share_out(elements_.closed, count, 0.0, elements_.perimeter_m, stations_);
  }
  chain_.nodes.clear();
  for (std::size_t at = 0; at < stations_.size(); ++at) {
    const Station& station = stations_[at];
    if (station.corner != Station::kNoCorner) {
      const BoundaryCorner& corner = corners_[station.corner];
      chain_.nodes.push_back({corner.p_m, corner.yaw_in_rad, corner.yaw_out_rad, true, corner.p_m});
      continue;
    }
    const double s_m = elements_.closed ? std::fmod(station.s_m, elements_.perimeter_m) : station.s_m;
    const auto upper = static_cast<std::size_t>(std::upper_bound(elements_.s_m.begin(), elements_.s_m.end(), s_m) -
                                                elements_.s_m.begin());
    const std::size_t below = upper > 0 ? upper - 1 : 0;
    const std::size_t above = upper < n ? upper : (elements_.closed ? 0 : n - 1);
    const auto away_m = [&](std::size_t i) {  // along the boundary, signed
      const double d_m = elements_.s_m[i] - s_m;
      return elements_.closed ? std::remainder(d_m, elements_.perimeter_m) : d_m;
    };
    double low_m = -1.0, high_m = 1.0;  // a third of the way to the next ones
    const auto way_to_m = [&](std::size_t other) {
      const double d_m = stations_[other].s_m - station.s_m;
      return elements_.closed ? std::remainder(d_m, elements_.perimeter_m) : d_m;
    };
    if (at > 0 || elements_.closed) {
      low_m = std::max(low_m, -0.3 * std::abs(way_to_m((at + stations_.size() - 1) % stations_.size())));
    }
    if (at + 1 < stations_.size() || elements_.closed) {
      high_m = std::min(high_m, 0.3 * std::abs(way_to_m((at + 1) % stations_.size())));
    }
    low_m = std::min(low_m, -0.05);
    high_m = std::max(high_m, 0.05);
    LineSums sums;
    std::size_t first = below, last = below;
    for (std::size_t k = 0, i = below; k<n / 2; ++k, i = i> 0 ? i - 1 : n - 1) {
      if (away_m(i) < low_m || away_m(i) > high_m) break;
      sums.add(elements_.points_m[i], elements_.weights[i] * elements_.weights[i]);
      first = i;
      if (!elements_.closed && i == 0) break;
    }
    for (std::size_t k = 0, i = above; k < n / 2 && i != below; ++k, i = i + 1 < n ? i + 1 : 0) {
      if (away_m(i) < low_m || away_m(i) > high_m) break;
      sums.add(elements_.points_m[i], elements_.weights[i] * elements_.weights[i]);
      last = i;
      if (!elements_.closed && i + 1 == n) break;
    }
    BiarcChain::Node node{};
    if (sums.n >= 3 && (elements_.points_m[last] - elements_.points_m[first]).norm() > 0.25 * (high_m - low_m)) {
      LineSums::Line line = sums.line();
      if (line.along.dot(elements_.points_m[last] - elements_.points_m[first]) < 0.0) line.along = -line.along;
      const Eigen::Vector2d at_m =
          elements_.points_m[below] +
          (above == below ? 0.0
                          : std::clamp(-away_m(below) / std::max(away_m(above) - away_m(below), 1e-9), 0.0, 1.0)) *
              (elements_.points_m[above] - elements_.points_m[below]);
      node.p_m = line.mean + line.along * line.along.dot(at_m - line.mean);
      node.yaw_in_rad = yaw_of(line.along);
    } else {  // in a gap
      const std::size_t from = below == above ? (below > 0 ? below - 1 : below) : below;
      const std::size_t to = below == above && below == 0 ? 1 : above;
      const double edge_m = std::max((elements_.points_m[to] - elements_.points_m[from]).norm(), 1e-9);
      node.p_m = elements_.points_m[from] +
                 (elements_.points_m[to] - elements_.points_m[from]) * std::clamp(-away_m(from) / edge_m, 0.0, 1.0);
      node.yaw_in_rad = yaw_of(elements_.points_m[to] - elements_.points_m[from]);
    }
    node.yaw_out_rad = node.yaw_in_rad;
    node.found_m = node.p_m;
    chain_.nodes.push_back(node);
  }
  chain_.compute_arcs();
  // Elements are of the half biarc that they are in.
  chain_.arc_of.resize(n);
  assign_by_stations(elements_.s_m, elements_.perimeter_m);
}

/// `at_m`: place of each element along the boundary, where the nodes have their stations.
void MainVertices::assign_by_stations(const std::vector<double>& at_m, double whole_m) {
  for (std::size_t i = 0; i < at_m.size(); ++i) {
    double s_m = at_m[i];
    if (elements_.closed && s_m < stations_[0].s_m) s_m += whole_m;
    const auto after = std::upper_bound(stations_.begin(), stations_.end(), s_m,
                                        [](double s, const Station& station) { return s < station.s_m; });
    const auto upper = static_cast<std::size_t>(after - stations_.begin());
    const std::size_t k = std::min(upper > 0 ? upper - 1 : 0, chain_.biarcs() - 1);
    const double end_m = k + 1 < stations_.size() ? stations_[k + 1].s_m : stations_[0].s_m + whole_m;
    chain_.arc_of[i] = 2 * k + (s_m > 0.5 * (stations_[k].s_m + end_m) ? 1 : 0);
  }
}

bool MainVertices::place_on_earlier(const std::vector<SplinegonVertex>& vertices) {
  if (vertices.size() < 3 || (vertices.size() % 2 == 0) != elements_.closed) return false;
  const std::size_t count = (vertices.size() + 1) / 2;
  if (count < wanted_nodes() ||
      count > std::max(elements_.points_m.size() / BoundaryElements::kElementsOfVertex, kFewestOfClosed)) {
    return false;
  }
  chain_.nodes.clear();
  for (std::size_t k = 0; k < count; ++k) {
    const SplinegonVertex& vertex = vertices[2 * k];
    const auto yaw_rad = [&](std::size_t arc, double sign) {  // at the begin or the end of an arc
      const Eigen::Vector2d chord =
          vertices[arc + 1 < vertices.size() ? arc + 1 : 0].p_world_m - vertices[arc].p_world_m;
      return yaw_of(chord) + sign * 2.0 * std::atan(vertices[arc].bulge);
    };
    BiarcChain::Node node{vertex.p_world_m - elements_.origin_m, 0.0, 0.0, vertex.corner,
                          vertex.p_world_m - elements_.origin_m};
    const bool has_out = elements_.closed || k + 1 < count, has_in = elements_.closed || k > 0;
    if (has_out) node.yaw_out_rad = yaw_rad(2 * k, -1.0);
    node.yaw_in_rad = has_in ? yaw_rad(k > 0 ? 2 * k - 1 : vertices.size() - 1, 1.0) : node.yaw_out_rad;
    if (!has_out || !node.corner) node.yaw_out_rad = node.yaw_in_rad;
    // The corners of a polygon may be beside each other where there is one.
    BiarcChain::Node* const before = chain_.nodes.empty() ? nullptr : &chain_.nodes.back();
    if (before != nullptr && before->corner && node.corner &&
        (node.p_m - before->p_m).norm() < BoundaryCorner::kApart * BoundaryCorner::kWindow_m) {
      before->yaw_out_rad = node.yaw_out_rad;
      continue;
    }
    chain_.nodes.push_back(node);
  }
  if (chain_.nodes.size() < wanted_nodes()) return false;
  chain_.compute_arcs();
  if (!chain_.assign_nearest(elements_)) return false;
  missing_.clear();
  for (std::size_t c = 0; c < corners_.size(); ++c) {
    const std::size_t biarc = chain_.arc_of[element_after(corners_[c])] / 2;
    const auto is_here = [&](std::size_t k) {
      return chain_.nodes[k].corner && (corners_[c].p_m - chain_.nodes[k].p_m).norm() < 0.5 * BoundaryCorner::kWindow_m;
    };
    if (!is_here(biarc) && !is_here(chain_.next_node(biarc))) missing_.push_back(c);
  }
  const auto corners = static_cast<std::size_t>(std::count_if(
      chain_.nodes.begin(), chain_.nodes.end(), [](const BiarcChain::Node& node) { return node.corner; }));
  if (chain_.nodes.size() == wanted_nodes() ? !missing_.empty() || corners > corners_.size()
                                            : 4 * missing_.size() > corners_.size()) {
    return false;
  }
  if (!elements_.closed) {
    // It must reach about as far as the elements.
    const double mean_m = elements_.perimeter_m / static_cast<double>(chain_.nodes.size());
    if ((elements_.points_m.front() - chain_.nodes.front().p_m).norm() > mean_m ||
        (elements_.points_m.back() - chain_.nodes.back().p_m).norm() > mean_m) {
      return false;
    }
  }
  add_missing_corners();
  return true;
}

std::size_t MainVertices::element_after(const BoundaryCorner& corner) const {
  const auto after = std::lower_bound(elements_.s_m.begin(), elements_.s_m.end(), corner.s_m) - elements_.s_m.begin();
  return std::min(static_cast<std::size_t>(after), elements_.s_m.size() - 1);
}

void MainVertices::add_missing_corners() {
  if (missing_.empty()) return;
  measure();
  keep_stations();
  for (const std::size_t c : missing_) {
    const BoundaryCorner& corner = corners_[c];
    const double s_m = element_s_m_[element_after(corner)];
    const auto at = std::upper_bound(stations_.begin(), stations_.end(), s_m,
                                     [](double s, const Station& station) { return s < station.s_m; });
    stations_.insert(at, {s_m, chain_.nodes.size()});
    chain_.nodes.push_back({corner.p_m, corner.yaw_in_rad, corner.yaw_out_rad, true, corner.p_m});
  }
  place_at_stations();
}

void MainVertices::place_again() {
  measure();
  if (chain_.nodes.size() > wanted_nodes()) {
    keep_stations();
  } else {
    share_out_again();
  }
  place_at_stations();
}

/// Stations of the arcs, and of the elements.
void MainVertices::measure() {
  const std::size_t count = chain_.arcs.size();
  const std::size_t n = elements_.points_m.size();
  arc_s_m_.assign(1, 0.0);
  for (const BiarcChain::Arc& arc : chain_.arcs) arc_s_m_.push_back(arc_s_m_.back() + arc.length_m);
  element_s_m_.resize(n);
  for (std::size_t i = 0; i < n; ++i) {
    const BiarcChain::Arc& arc = chain_.arcs[chain_.arc_of[i]];
    const double foot_m = chain_.way_to_foot_m(elements_.points_m[i], chain_.arc_of[i]);
    const double low_m = !elements_.closed && chain_.arc_of[i] == 0 ? -1e9 : 0.0;
    const double high_m = !elements_.closed && chain_.arc_of[i] + 1 == count ? 1e9 : arc.length_m;
    element_s_m_[i] = arc_s_m_[chain_.arc_of[i]] + std::clamp(foot_m, low_m, high_m);
  }
}

/// All nodes where they are, but that the ends of an open boundary are those of the elements.
void MainVertices::keep_stations() {
  stations_.clear();
  for (std::size_t k = 0; k < chain_.nodes.size(); ++k) {
    stations_.push_back(
        {k < chain_.biarcs() ? arc_s_m_[2 * k] : arc_s_m_.back(), is_break(chain_.nodes[k]) ? k : Station::kNoCorner});
  }
  if (elements_.closed) return;
  stations_.front() = {*std::min_element(element_s_m_.begin(), element_s_m_.end()), Station::kNoCorner};
  stations_.back() = {*std::max_element(element_s_m_.begin(), element_s_m_.end()), Station::kNoCorner};
  const auto is_beyond = [&](const Station& station) {
    return &station != &stations_.front() && &station != &stations_.back() &&
           (station.s_m <= stations_.front().s_m || station.s_m >= stations_.back().s_m);
  };
  stations_.erase(std::remove_if(stations_.begin(), stations_.end(), is_beyond), stations_.end());
}

void MainVertices::share_out_again() {
  const std::size_t count = chain_.arcs.size();
  const double whole_m = arc_s_m_.back();
  shares_.cell_s_m = arc_s_m_;
  // Slope of the curvature at the begin of each arc.
  slope_.assign(count + 1, -1.0);
  for (std::size_t j = 0; j < count; ++j) {
    if (!chain_.is_smooth(j)) continue;
    const BiarcChain::Arc& before = chain_.arcs[j > 0 ? j - 1 : count - 1];
    slope_[j] = std::cbrt(2.0 * std::abs(chain_.arcs[j].curvature_1pm - before.curvature_1pm) /
                          (chain_.arcs[j].length_m + before.length_m));
  }
  slope_[count] = elements_.closed ? slope_[0] : -1.0;
  shares_.share.assign(count, 0.0);
  double mean = 0.0;
  for (std::size_t j = 0; j < count; ++j) {
    const double at_begin = slope_[j], at_end = slope_[j + 1];
    shares_.share[j] = at_begin < 0.0 ? std::max(at_end, 0.0) : at_end < 0.0 ? at_begin : 0.5 * (at_begin + at_end);
    mean += shares_.share[j] * chain_.arcs[j].length_m / whole_m;
  }
  const double least = std::max(mean, 1e-6) / (kSpacingRatio - 1.0);
  for (double& share : shares_.share) share += least;
  thin_out_gaps();
  double from_m = 0.0, to_m = whole_m;
  if (!elements_.closed) {
    from_m = *std::min_element(element_s_m_.begin(), element_s_m_.end());
    to_m = *std::max_element(element_s_m_.begin(), element_s_m_.end());
  }
  stations_.clear();
  for (std::size_t k = 0; k < chain_.nodes.size(); ++k) {
    if (is_break(chain_.nodes[k])) stations_.push_back({shares_.cell_s_m[2 * k], k});
  }
  shares_.share_out(elements_.closed, chain_.nodes.size(), from_m, to_m, stations_);
}

/// Nodes at the stations, on the fitted curve.
void MainVertices::place_at_stations() {
  const std::size_t count = chain_.arcs.size();
  const double whole_m = arc_s_m_.back();
  std::swap(chain_.nodes, nodes_before_);
  chain_.nodes.clear();
  for (const Station& station : stations_) {
    if (station.corner != Station::kNoCorner) {
      chain_.nodes.push_back(nodes_before_[station.corner]);
      continue;
    }
    const double s_m = elements_.closed && station.s_m >= whole_m ? station.s_m - whole_m : station.s_m;
    const auto after =
        static_cast<std::size_t>(std::upper_bound(arc_s_m_.begin(), arc_s_m_.end(), s_m) - arc_s_m_.begin());
    const std::size_t j = std::min(after > 0 ? after - 1 : 0, count - 1);
    const double on_m = s_m - arc_s_m_[j];
    const BiarcChain::Arc& arc = chain_.arcs[j];
    const double yaw_rad = arc.begin_yaw_rad + arc.curvature_1pm * on_m;
    const Eigen::Vector2d p_m = point_on(arc, on_m);
    chain_.nodes.push_back({p_m, yaw_rad, yaw_rad, false, p_m});
  }
  assign_by_stations(element_s_m_, whole_m);
  chain_.compute_arcs();
}

bool MainVertices::part_misfits() {
  sum_residuals(elements_, chain_, residuals_);
  if (std::none_of(residuals_.begin(), residuals_.end(), is_misfit)) return false;
  measure();
  const double whole_m = arc_s_m_.back();
  keep_stations();
  const std::size_t biarcs_before = chain_.biarcs();
  std::swap(stations_, arc_ends_);
  stations_.clear();
  bool parted = false;
  const bool is_whole = arc_ends_.size() == chain_.nodes.size();  // else an end was cut off
  for (std::size_t at = 0; at < arc_ends_.size(); ++at) {
    stations_.push_back(arc_ends_[at]);
    if (!is_whole || at == biarcs_before) continue;
    const BiarcResiduals& sums = residuals_[at];
    if (!is_misfit(sums)) continue;
    const double from_m = arc_ends_[at].s_m;
    const double to_m = at + 1 < arc_ends_.size() ? arc_ends_[at + 1].s_m : whole_m;
    const double common = std::sqrt(std::max(sums.products, 0.0) / sums.elements);
    const double most =
        std::min(kMostParts, std::floor(sums.elements / static_cast<double>(BoundaryElements::kElementsOfVertex)));
    const double parts = std::min(std::max(std::ceil(std::cbrt(2.0 * common)), 2.0), most);
    for (double part = 1.0; part < parts; part += 1.0) {
      stations_.push_back({from_m + part / parts * (to_m - from_m), Station::kNoCorner});
    }
    parted |= parts >= 2.0;
  }
  if (is_whole && !parted) return false;
  place_at_stations();
  return true;
}

/// Lowers the density of main vertices where there are no elements.
void MainVertices::thin_out_gaps() {
  const double whole_m = arc_s_m_.back();
  const auto thin_out = [&](double from_m, double to_m) {
    for (const double at_m : {from_m, to_m}) {  // cells end there
      const auto upper = std::upper_bound(shares_.cell_s_m.begin(), shares_.cell_s_m.end(), at_m);
      if (upper == shares_.cell_s_m.begin() || upper == shares_.cell_s_m.end() || *(upper - 1) == at_m) continue;
      const auto cell = upper - shares_.cell_s_m.begin() - 1;
      shares_.share.insert(shares_.share.begin() + cell, shares_.share[static_cast<std::size_t>(cell)]);
      shares_.cell_s_m.insert(upper, at_m);
    }
    for (std::size_t c = 0; c < shares_.share.size(); ++c) {
      if (shares_.cell_s_m[c] >= from_m && shares_.cell_s_m[c + 1] <= to_m) shares_.share[c] = kGapShare;
    }
  };
  for (const BoundaryElements::Gap& gap : elements_.gaps) {
    const double from_m = element_s_m_[gap.last], to_m = element_s_m_[gap.next];
    if (from_m < to_m) {
      thin_out(from_m, to_m);
    } else if (elements_.closed && from_m > to_m + 0.5 * whole_m) {
      thin_out(from_m, whole_m);
      thin_out(0.0, to_m);
    }
  }
}

}  // namespace situation_awareness

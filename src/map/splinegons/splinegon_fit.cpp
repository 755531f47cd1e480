// SPDX-License-Identifier: BSD-3-Clause
#include "situation_awareness/map/splinegons/splinegon_fit.hpp"

#include <algorithm>
#include <cmath>

#include "biarc_chain.hpp"
#include "biarc_least_squares.hpp"
#include "boundary_corners.hpp"
#include "boundary_elements.hpp"
#include "expected_jumps.hpp"
#include "main_vertices.hpp"
#include "polygon_parts.hpp"
#include "residual_bounds.hpp"
#include "situation_awareness/geometry/angles.hpp"

namespace situation_awareness {
namespace {

// Where no source is named, none is recorded; the sensitivity of these was not measured.

/// Root mean square distance of a biarc from a curve with linear curvature, over jump * length^2, where the ends are
/// fitted too; with ends on the curve it would be 1 / 328.
constexpr double kJumpRms = 1.0 / 500.0;
/// Standard deviation in the middle of a gap, over mean curvature * length^2: a curve with twice the mean curvature is
/// as far from the chord.
constexpr double kGapSigma = 1.0 / 16.0;
/// The same of a corner that may be in the gap, over length * tan(turn / 2): a quarter of its distance from the chord.
constexpr double kGapCorner = 1.0 / 8.0;
/// Largest correlation of the residuals of neighbouring elements that is believed.
constexpr double kMostCorrelation = 0.7;
/// Rounds in which biarcs that do not follow the boundary are parted.
constexpr int kMostRounds = 6;

}  // namespace

void SplinegonFitParams::validate() const { check_bounds(*this, "splinegon_fit"); }

class SplinegonFit::Impl {
 public:
  explicit Impl(const SplinegonFitParams& params)
      : corners_(elements_),
        vertices_((params.validate(), static_cast<std::size_t>(params.vertices)), elements_, corners_.corners(),
                  chain_),
        jumps_(elements_, chain_),
        least_squares_(elements_, jumps_, chain_),
        polygons_(elements_, chain_) {}

  SplinegonFitQuality fit(const std::vector<SplinegonElement>& elements, bool closed,
                          std::vector<SplinegonVertex>& vertices, bool follow_tips);
  void fit_polygon(const std::vector<SplinegonElement>& elements, bool closed, std::vector<SplinegonVertex>& vertices);

 private:
  void remove_if_degenerate(std::vector<SplinegonVertex>& vertices) const;
  double chi2_per_freedom() const;
  double correlation_factor() const;
  void measure_gaps();
  void write(double scale, std::vector<SplinegonVertex>& vertices);

  BoundaryElements elements_;
  CornerSearch corners_;
  BiarcChain chain_;
  MainVertices vertices_;
  ExpectedJumps jumps_;
  BiarcLeastSquares least_squares_;
  PolygonParts polygons_;
  std::vector<double> gap_m_;  ///< the largest gap of each biarc
};

SplinegonFitQuality SplinegonFit::Impl::fit(const std::vector<SplinegonElement>& elements, bool closed,
                                            std::vector<SplinegonVertex>& vertices, bool follow_tips) {
  SplinegonFitQuality quality;
  elements_.closed = chain_.closed = closed;
  elements_.follow_tips = follow_tips;
  if (!elements_.take(elements)) {
    vertices.clear();
    return quality;
  }
  corners_.find();
  quality.warm = vertices_.place_on_earlier(vertices);
  if (quality.warm) {
    jumps_.expect(false);
    least_squares_.iterate(4);
    if (chi2_per_freedom() > 2.0) quality.warm = false;
  }
  if (!quality.warm) {
    vertices_.place_on_elements();
    jumps_.expect(true);
    least_squares_.iterate(4);
    for (int round = 0; round < 2; ++round) {
      vertices_.place_again();
      jumps_.expect(false);
      least_squares_.iterate(4);
      if (chain_.nodes.size() > vertices_.wanted_nodes()) break;  // they stay where arcs end
    }
  }
  vertices_.place_again();
  jumps_.expect(false);
  least_squares_.iterate(6);
  for (int round = 0; round < kMostRounds && vertices_.part_misfits(); ++round) {
    jumps_.expect(false);
    least_squares_.iterate(6);
  }
  write(std::max(1.0, chi2_per_freedom()) * correlation_factor(), vertices);
  remove_if_degenerate(vertices);
  quality.as_polygon = static_cast<int>(polygons_.count());
  return quality;
}

void SplinegonFit::Impl::fit_polygon(const std::vector<SplinegonElement>& elements, bool closed,
                                     std::vector<SplinegonVertex>& vertices) {
  elements_.closed = closed;
  vertices.clear();
  polygons_.clear_corners();
  if (elements_.take(elements)) {
    for (std::size_t i = 0; i < elements_.points_m.size(); ++i) {
      polygons_.add_corner(elements_.points_m[i], 1.0 / elements_.weights[i]);
    }
  } else {
    for (const SplinegonElement& element : elements) {
      elements_.origin_m = elements[0].p_world_m;
      polygons_.add_corner(element.p_world_m - elements_.origin_m, std::sqrt(element.variance_m2));
    }
  }
  polygons_.append_corners(!closed, closed, vertices);
  remove_if_degenerate(vertices);
}

/// Elements that go to and fro may have no chain of arcs.
void SplinegonFit::Impl::remove_if_degenerate(std::vector<SplinegonVertex>& vertices) const {
  bool is_sound = vertices.size() >= (elements_.closed ? 4U : 3U);
  for (std::size_t k = 0; k < vertices.size(); ++k) {
    const SplinegonVertex& vertex = vertices[k];
    const SplinegonVertex& next = vertices[k + 1 < vertices.size() ? k + 1 : 0];
    is_sound &= std::isfinite(vertex.sigma_m) && std::isfinite(vertex.bulge) &&
                (next.p_world_m - vertex.p_world_m).norm() > BiarcChain::kShortestArc_m;
  }
  if (!is_sound) vertices.clear();
}

/// By how much more the fit varies than with independent elements, if their errors are correlated as the residuals of
/// neighbours: (1 + r) / (1 - r) for a first-order process.
double SplinegonFit::Impl::correlation_factor() const {
  double products = 0.0, squares = 0.0, before = 0.0;
  for (std::size_t i = 0; i < elements_.points_m.size(); ++i) {
    const double sigmas = chain_.of_elements[i].distance_m * elements_.weights[i];
    const double clipped = std::clamp(sigmas, -3.0, 3.0);
    products += clipped * before;
    squares += clipped * clipped;
    before = clipped;
  }
  const double r = std::clamp(products / std::max(squares, 1e-12), 0.0, kMostCorrelation);
  return (1.0 + r) / (1.0 - r);
}

/// Lengths of the largest gaps that biarcs are in.
void SplinegonFit::Impl::measure_gaps() {
  gap_m_.assign(chain_.biarcs(), 0.0);
  for (const BoundaryElements::Gap& gap : elements_.gaps) {
    const std::size_t first = chain_.arc_of[gap.last] / 2, last = chain_.arc_of[gap.next] / 2;
    const double length_m = (elements_.points_m[gap.next] - elements_.points_m[gap.last]).norm();
    if (!elements_.closed && last < first) continue;
    for (std::size_t k = first;; k = k + 1 < chain_.biarcs() ? k + 1 : 0) {
      gap_m_[k] = std::max(gap_m_[k], length_m);
      if (k == last) break;
    }
  }
}

double SplinegonFit::Impl::chi2_per_freedom() const {
  double sum = 0.0;
  for (std::size_t i = 0; i < elements_.points_m.size(); ++i) {
    const double sigmas = chain_.of_elements[i].distance_m * elements_.weights[i];
    sum += std::min(sigmas * sigmas, kMostChi2);
  }
  const auto elements = static_cast<double>(elements_.points_m.size());
  return sum / std::max(elements - jumps_.parameters(), elements / 3.0);
}

void SplinegonFit::Impl::write(double scale, std::vector<SplinegonVertex>& vertices) {
  least_squares_.find_covariance();
  chain_.assign_nearest(elements_);  // stepwise, elements are behind where a main vertex has moved far
  chain_.compute_residuals(elements_);
  measure_gaps();
  polygons_.find();
  double turn_rad = 0.0, length_m = 0.0;
  for (const BiarcChain::Arc& arc : chain_.arcs) {
    turn_rad += std::abs(arc.curvature_1pm) * arc.length_m;
    length_m += arc.length_m;
  }
  const double mean_curvature_1pm = turn_rad / length_m;
  // What arcs cannot follow, and what they did not.
  const auto model_m2 = [&](std::size_t biarc) {
    const BiarcChain::Arc& first = chain_.arcs[2 * biarc];
    const BiarcChain::Arc& second = chain_.arcs[2 * biarc + 1];
    const double both_m = first.length_m + second.length_m;
    const double arcs_m = kJumpRms * std::abs(second.curvature_1pm - first.curvature_1pm) * both_m * both_m;
    const BiarcResiduals& sums = polygons_.residuals(biarc);
    double misfit_m2 = 0.0;
    if (is_misfit(sums)) misfit_m2 = sums.squares_m2 / sums.elements;
    return std::max(arcs_m * arcs_m, misfit_m2);
  };
  const auto node_vertex = [&](std::size_t k) {
    const BiarcChain::Node& node = chain_.nodes[k];
    const bool has_out = elements_.closed || k + 1 < chain_.nodes.size(), has_in = elements_.closed || k > 0;
    const double before_m2 = model_m2(has_in ? (k > 0 ? k - 1 : chain_.biarcs() - 1) : k);
    const double after_m2 = model_m2(has_out ? k : k - 1);
    const auto across = [&](double yaw_rad) { return least_squares_.variance_across_m2(k, yaw_rad, scale); };
    double of_fit_m2 = across(node.yaw_in_rad);
    if (node.corner) of_fit_m2 = std::max(of_fit_m2, across(node.yaw_out_rad));
    const double of_model_m2 = 0.5 * (before_m2 + after_m2);
    SplinegonVertex vertex;
    vertex.p_world_m = (has_out ? polygons_.begin_of(k) : node.p_m) + elements_.origin_m;
    vertex.sigma_m = std::sqrt(of_fit_m2 + of_model_m2);
    vertex.corner = node.corner;
    if (has_out) {
      const BiarcChain::Arc& first = chain_.arcs[2 * k];
      vertex.bulge = std::tan(0.25 * first.curvature_1pm * (first.length_m - polygons_.cut_m(2 * k)));
    }
    return vertex;
  };
  const auto joint_vertex = [&](std::size_t k) {
    const double after_m2 = model_m2(k);
    const BiarcChain::Arc& second = chain_.arcs[2 * k + 1];
    SplinegonVertex joint;
    joint.p_world_m = second.begin_m + elements_.origin_m;
    joint.bulge = std::tan(0.25 * second.curvature_1pm * (second.length_m - polygons_.cut_m(2 * k + 1)));
    const double joint_m2 = least_squares_.variance_m2(k, chain_.residual_of(second.begin_m, 2 * k).slope, scale);
    const double gap_m = gap_m_[k];
    const double turn_over_rad = std::abs(chain_.arcs[2 * k].curvature_1pm * chain_.arcs[2 * k].length_m +
                                          second.curvature_1pm * second.length_m);
    const double over_gap_m = gap_m * (kGapSigma * mean_curvature_1pm * gap_m +
                                       kGapCorner * std::tan(0.5 * std::min(turn_over_rad, 0.5 * kPi)));
    joint.sigma_m = std::sqrt(joint_m2 + after_m2 + over_gap_m * over_gap_m);
    return joint;
  };
  const std::size_t count = chain_.biarcs();
  std::size_t start = 0;
  while (elements_.closed && start < count && polygons_.contains((start + count - 1) % count)) ++start;
  vertices.clear();
  if (start == count) return polygons_.append(0, count, vertices);
  for (std::size_t done = 0; done < count;) {
    const std::size_t k = (start + done) % count;
    std::size_t run = 0;
    while (done + run < count && polygons_.contains((k + run) % count)) ++run;
    if (run > 0) {
      const SplinegonVertex begin = node_vertex(k);
      if (elements_.closed || done > 0) vertices.push_back(begin);
      polygons_.append(k, run, vertices);
      done += run;
      continue;
    }
    vertices.push_back(node_vertex(k));
    vertices.back().corner |= (elements_.closed || k > 0) && polygons_.contains((k + count - 1) % count);
    vertices.push_back(joint_vertex(k));
    ++done;
  }
  if (!elements_.closed && !polygons_.contains(count - 1)) vertices.push_back(node_vertex(count));
}

SplinegonFit::SplinegonFit(const SplinegonFitParams& params) : impl_(std::make_unique<Impl>(params)) {}
SplinegonFit::~SplinegonFit() = default;
SplinegonFit::SplinegonFit(SplinegonFit&&) noexcept = default;
SplinegonFit& SplinegonFit::operator=(SplinegonFit&&) noexcept = default;

SplinegonFitQuality SplinegonFit::fit(const std::vector<SplinegonElement>& elements, bool closed,
                                      std::vector<SplinegonVertex>& vertices, bool follow_tips) {
  return impl_->fit(elements, closed, vertices, follow_tips);
}
void SplinegonFit::fit_polygon(const std::vector<SplinegonElement>& elements, bool closed,
                               std::vector<SplinegonVertex>& vertices) {
  impl_->fit_polygon(elements, closed, vertices);
}

}  // namespace situation_awareness

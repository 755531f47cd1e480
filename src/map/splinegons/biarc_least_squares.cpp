// SPDX-License-Identifier: BSD-3-Clause
#include "biarc_least_squares.hpp"

#include <algorithm>
#include <cmath>

#include "directions.hpp"
#include "residual_bounds.hpp"
#include "situation_awareness/geometry/angles.hpp"
#include "situation_awareness/geometry/vectors.hpp"

namespace situation_awareness {
namespace {

// Where no source is named, none is recorded; the sensitivity of these was not measured.

/// Part of a biarc's length by which a main vertex may move along the boundary in a step. What the elements say of it
/// is of the same order, so half or twice as much changes nothing but the number of steps.
constexpr double kAlongStep = 0.1;
/// Part of the chord of a biarc that is left in a step, at least.
constexpr double kLeastOfChord = 0.1;
/// m. A step that moves no main vertex further is the last.
constexpr double kNoChange_m = 2e-4;
/// m^-2, rad^-2. Keeps main vertices and tangents where hardly any elements are.
constexpr double kHoldAcross = 10.0, kHoldYaw = 1.0;
/// m. By how much a biarc at a corner is off its chord which hardly any element tells.
constexpr double kStraight_m = 0.01;
/// m. How far a corner is from where it was found.
constexpr double kCorner_m = 0.1;

}  // namespace

/// Adds what a slope by the places and yaws of a biarc's nodes is by the unknowns.
void BiarcLeastSquares::add_to_row(const Vector6d& slope, std::size_t biarc) {
  const std::size_t next = chain_.next_node(biarc);
  const Unknowns& from = unknowns_of_[biarc];
  const Unknowns& to = unknowns_of_[next];
  row_(from.first) += from.along.dot(slope.segment<2>(0));
  row_(from.first + 1) += left_of(from.along).dot(slope.segment<2>(0));
  row_(from.first + (chain_.nodes[biarc].corner ? 3 : 2)) += slope(2);
  row_(to.first) += to.along.dot(slope.segment<2>(3));
  row_(to.first + 1) += left_of(to.along).dot(slope.segment<2>(3));
  row_(to.first + 2) += slope(5);
}

/// Normal equations at the nodes, after compute_residuals(); returns the cost.
double BiarcLeastSquares::build() {
  unknowns_of_.resize(chain_.nodes.size());
  unknowns_ = 0;
  // Nodes of a closed boundary are in the order 0, n - 1, 1, n - 2 and so on: then what is near is near along both
  // ways.
  const auto node_at = [&](std::size_t at) {
    return !elements_.closed ? at : at % 2 == 0 ? at / 2 : chain_.nodes.size() - 1 - at / 2;
  };
  for (std::size_t at = 0; at < chain_.nodes.size(); ++at) {
    const std::size_t k = node_at(at);
    const BiarcChain::Node& node = chain_.nodes[k];
    const bool has_one_tangent = node.yaw_in_rad == node.yaw_out_rad;
    unknowns_of_[k] = {unknowns_, has_one_tangent
                                      ? (k < chain_.biarcs() ? chain_.arcs[2 * k] : chain_.arcs[2 * k - 1]).along
                                      : unit(0.5 * wrap_to_pi(node.yaw_out_rad - node.yaw_in_rad) + node.yaw_in_rad)};
    unknowns_ += node.corner ? 4 : 3;
  }
  Eigen::Index below = 0;  // a node has to do with those beside it, and with those beside them
  for (std::size_t at = 0; at < chain_.nodes.size(); ++at) {
    const std::size_t k = node_at(at),
                      last = node_at(std::min(at + (elements_.closed ? 4 : 2), chain_.nodes.size() - 1));
    below = std::max(below, unknowns_of_[last].first + unknowns_at(last) - 1 - unknowns_of_[k].first);
  }
  H_.reset(unknowns_, below);
  if (g_.size() < unknowns_ + 4) g_.resize(2 * unknowns_ + 4);
  if (row_.size() < unknowns_ + 4) {
    delta_.resize(2 * unknowns_ + 4);
    row_.setZero(2 * unknowns_ + 4);
  }
  g_.head(unknowns_).setZero();
  double cost = 0.0;
  // The elements' sums by places and yaws of the nodes, for each biarc.
  sums_.assign(chain_.biarcs(), {Matrix6d::Zero(), Vector6d::Zero(), 0});
  for (std::size_t i = 0; i < elements_.points_m.size(); ++i) {
    const BiarcChain::Residual& residual = chain_.of_elements[i];
    const double sigmas = std::abs(residual.distance_m) * elements_.weights[i];
    const double huber = std::min(1.0, kHuberSigmas / std::max(sigmas, 1e-12));
    cost += huber < 1.0 ? kHuberSigmas * (2.0 * sigmas - kHuberSigmas) : sigmas * sigmas;
    const Vector6d weighted = huber * elements_.weights[i] * elements_.weights[i] * residual.slope;
    Sums& sums = sums_[chain_.arc_of[i] / 2];
    sums.H.noalias() += weighted * residual.slope.transpose();
    sums.g += residual.distance_m * weighted;
    ++sums.elements;
  }
  for (std::size_t k = 0; k < chain_.biarcs(); ++k) {
    add_sums(k);
    if (sums_[k].elements < BoundaryElements::kElementsOfArc &&
        (chain_.nodes[k].corner || chain_.nodes[chain_.next_node(k)].corner))
      cost += straighten(k);
  }
  for (std::size_t k = 0; k < chain_.nodes.size(); ++k) {
    if (!chain_.nodes[k].corner) continue;
    const Unknowns& of = unknowns_of_[k];
    const Eigen::Vector2d moved_m = chain_.nodes[k].p_m - chain_.nodes[k].found_m;
    constexpr double kWeight = 1.0 / (kCorner_m * kCorner_m);
    for (Eigen::Index i = 0; i < 2; ++i) {
      H_(of.first + i, of.first + i) += kWeight;
      g_(of.first + i) += kWeight * (i == 0 ? of.along : left_of(of.along)).dot(moved_m);
    }
    cost += kWeight * moved_m.squaredNorm();
  }
  for (std::size_t j = 0; j < chain_.arcs.size(); ++j) {
    if (!chain_.is_smooth(j)) continue;
    const std::size_t before = j > 0 ? j - 1 : chain_.arcs.size() - 1;
    const double jump = chain_.arcs[j].curvature_1pm - chain_.arcs[before].curvature_1pm;
    const double weight = 1.0 / (jumps_.sigma_1pm(j) * jumps_.sigma_1pm(j));
    add_jump(before, j, jump, weight);
    cost += weight * jump * jump;
  }
  return cost;
}

/// Unknowns of the places and yaws of a biarc's nodes, and the derivatives of the ones by the others.
std::array<Eigen::Index, 6> BiarcLeastSquares::unknowns_of_biarc(std::size_t biarc, Matrix6d& J) const {
  std::array<Eigen::Index, 6> index{};
  J.setZero();
  for (Eigen::Index end = 0; end < 2; ++end) {
    const std::size_t k = end == 0 ? biarc : chain_.next_node(biarc);
    const Unknowns& of = unknowns_of_[k];
    J.block<2, 1>(3 * end, 3 * end) = of.along;
    J.block<2, 1>(3 * end, 3 * end + 1) = left_of(of.along);
    J(3 * end + 2, 3 * end + 2) = 1.0;
    const auto at = static_cast<std::size_t>(3 * end);
    index[at] = of.first;
    index[at + 1] = of.first + 1;
    index[at + 2] = of.first + (end == 0 && chain_.nodes[k].corner ? 3 : 2);
  }
  return index;
}

/// Adds the sums of a biarc's elements to the normal equations.
void BiarcLeastSquares::add_sums(std::size_t biarc) {
  Matrix6d J;
  const std::array<Eigen::Index, 6> index = unknowns_of_biarc(biarc, J);
  // J^T H J and J^T g: J has a rotation for each node's place, and 1 for its yaw.
  const Sums& sums = sums_[biarc];
  Matrix6d rows, H;
  Vector6d g;
  for (const Eigen::Index node : {0, 3}) {
    const Eigen::Matrix2d R = J.block<2, 2>(node, node);
    rows.middleRows<2>(node).noalias() = R.transpose() * sums.H.middleRows<2>(node);
    rows.row(node + 2) = sums.H.row(node + 2);
    g.segment<2>(node).noalias() = R.transpose() * sums.g.segment<2>(node);
    g(node + 2) = sums.g(node + 2);
  }
  for (const Eigen::Index node : {0, 3}) {
    H.middleCols<2>(node).noalias() = rows.middleCols<2>(node) * J.block<2, 2>(node, node);
    H.col(node + 2) = rows.col(node + 2);
  }
  for (std::size_t a = 0; a < 6; ++a) {
    g_(index[a]) += g(static_cast<Eigen::Index>(a));
    for (std::size_t b = 0; b < 6; ++b) {
      if (index[b] <= index[a]) {
        H_(index[a], index[b]) += H(static_cast<Eigen::Index>(a), static_cast<Eigen::Index>(b));
      }
    }
  }
}

/// Adds the expectation that a biarc is straight, which hardly any element tells; returns its cost.
double BiarcLeastSquares::straighten(std::size_t biarc) {
  double cost = 0.0;
  for (std::size_t j = 2 * biarc; j < 2 * biarc + 2; ++j) {
    const double length_m = chain_.arcs[2 * biarc].length_m + chain_.arcs[2 * biarc + 1].length_m;
    const double weight = std::pow(length_m * length_m / (8.0 * kStraight_m), 2);
    sums_[biarc].H.noalias() = weight * chain_.arcs[j].curvature_slope * chain_.arcs[j].curvature_slope.transpose();
    sums_[biarc].g.noalias() = weight * chain_.arcs[j].curvature_1pm * chain_.arcs[j].curvature_slope;
    add_sums(biarc);
    cost += weight * chain_.arcs[j].curvature_1pm * chain_.arcs[j].curvature_1pm;
  }
  return cost;
}

/// Adds the expectation of a jump of the curvature between two arcs.
void BiarcLeastSquares::add_jump(std::size_t before, std::size_t after, double jump, double weight) {
  const std::size_t first = before / 2, second = after / 2;
  const std::array<std::size_t, 3> nodes{first, second, chain_.next_node(second)};
  const auto begin = static_cast<std::size_t>(first == second ? 1 : 0);
  for (std::size_t n = begin; n < 3; ++n) row_.segment(unknowns_of_[nodes[n]].first, 4).setZero();
  add_to_row(chain_.arcs[after].curvature_slope, second);
  add_to_row(-chain_.arcs[before].curvature_slope, first);
  for (std::size_t n = begin; n < 3; ++n) {
    for (Eigen::Index i = 0; i < unknowns_at(nodes[n]); ++i) {
      const Eigen::Index row = unknowns_of_[nodes[n]].first + i;
      g_(row) += weight * jump * row_(row);
      for (std::size_t m = begin; m < 3; ++m) {
        for (Eigen::Index k = 0; k < unknowns_at(nodes[m]); ++k) {
          const Eigen::Index column = unknowns_of_[nodes[m]].first + k;
          if (column <= row) H_(row, column) += weight * row_(row) * row_(column);
        }
      }
    }
  }
}

/// Adds what keeps main vertices from sliding along the boundary, and from turning where no element says how.
void BiarcLeastSquares::hold(BandMatrix& H) const {
  for (std::size_t k = 0; k < chain_.nodes.size(); ++k) {
    double length_m = 0.0;
    if (elements_.closed || k + 1 < chain_.nodes.size()) length_m += chain_.arcs[2 * k].length_m;
    if (elements_.closed || k > 0) length_m += chain_.arcs[k > 0 ? 2 * k - 1 : chain_.arcs.size() - 1].length_m;
    const bool end = !elements_.closed && (k == 0 || k + 1 == chain_.nodes.size());
    const double step_m = (end ? 1e-6 : kAlongStep) * length_m;
    const Eigen::Index first = unknowns_of_[k].first;
    H(first, first) += 1.0 / (step_m * step_m);
    H(first + 1, first + 1) += kHoldAcross;
    for (Eigen::Index i = 2; i < unknowns_at(k); ++i) H(first + i, first + i) += kHoldYaw;
  }
}

void BiarcLeastSquares::swap_with_before() {
  H_.swap(H_before_);
  g_.swap(g_before_);
  unknowns_of_.swap(unknowns_of_before_);
  chain_.arcs.swap(arcs_before_);
  chain_.of_elements.swap(of_elements_before_);
}

/// Main vertices that would pass each other stay where they were before the step.
void BiarcLeastSquares::keep_order() {
  for (std::size_t k = 0; k < chain_.biarcs(); ++k) {
    BiarcChain::Node& from = chain_.nodes[k];
    BiarcChain::Node& to = chain_.nodes[chain_.next_node(k)];
    const Eigen::Vector2d& from_before_m = nodes_before_[k].p_m;
    const Eigen::Vector2d& to_before_m = nodes_before_[chain_.next_node(k)].p_m;
    const Eigen::Vector2d chord_m = to_before_m - from_before_m;
    if (chord_m.dot(to.p_m - from.p_m) >= kLeastOfChord * chord_m.squaredNorm()) continue;
    from.p_m = from_before_m;
    to.p_m = to_before_m;
  }
}

/// The equations, damped, into H_factor_.
void BiarcLeastSquares::factorize(double damping) {
  H_factor_ = H_;
  hold(H_factor_);
  H_factor_.scale_diagonal(1.0 + damping);
  H_factor_.factorize();
}

void BiarcLeastSquares::iterate(int most) {
  double damping = 1e-4;
  double cost = build();
  for (int step = 0; step < most; ++step) {
    factorize(damping);
    delta_.head(unknowns_) = -g_.head(unknowns_);
    H_factor_.solve(delta_);
    nodes_before_ = chain_.nodes;
    arc_of_before_ = chain_.arc_of;
    double largest_m = 0.0;
    for (std::size_t k = 0; k < chain_.nodes.size(); ++k) {
      BiarcChain::Node& node = chain_.nodes[k];
      const Unknowns& of = unknowns_of_[k];
      const double limit_m =
          0.5 * (elements_.closed || k > 0 ? chain_.arcs[k > 0 ? 2 * k - 1 : chain_.arcs.size() - 1].length_m
                                           : chain_.arcs[2 * k].length_m);
      const double along_m = std::clamp(delta_(of.first), -limit_m, limit_m);
      const double across_m = std::clamp(delta_(of.first + 1), -limit_m, limit_m);
      node.p_m += along_m * of.along + across_m * left_of(of.along);
      node.yaw_in_rad += std::clamp(delta_(of.first + 2), -0.5, 0.5);
      node.yaw_out_rad = node.corner ? node.yaw_out_rad + std::clamp(delta_(of.first + 3), -0.5, 0.5) : node.yaw_in_rad;
      largest_m = std::max({largest_m, std::abs(across_m), 0.02 * std::abs(along_m)});
    }
    keep_order();
    swap_with_before();
    chain_.compute_arcs();
    chain_.assign_stepwise(elements_);
    chain_.compute_residuals(elements_);
    const double new_cost = build();
    if (!(new_cost <= cost * (1.0 + 1e-3) + 1.0)) {
      chain_.nodes.swap(nodes_before_);
      chain_.arc_of.swap(arc_of_before_);
      swap_with_before();
      damping = std::max(10.0 * damping, 0.1);
      continue;
    }
    cost = new_cost;
    damping *= 0.2;
    if (largest_m < kNoChange_m) break;
  }
}

void BiarcLeastSquares::find_covariance() {
  factorize(1e-9);
  H_factor_.invert(covariance_);
}

double BiarcLeastSquares::variance_across_m2(std::size_t node, double yaw_rad, double scale) const {
  const Eigen::Index first = unknowns_of_[node].first;
  const Eigen::Vector2d normal = left_of(unit(yaw_rad));
  const Eigen::Vector2d row(unknowns_of_[node].along.dot(normal), left_of(unknowns_of_[node].along).dot(normal));
  return scale *
         (row.x() * row.x() * covariance_(first, first) + row.y() * row.y() * covariance_(first + 1, first + 1) +
          2.0 * row.x() * row.y() * covariance_(first + 1, first));
}

double BiarcLeastSquares::variance_m2(std::size_t biarc, const Vector6d& slope, double scale) const {
  Matrix6d J;
  const std::array<Eigen::Index, 6> index = unknowns_of_biarc(biarc, J);
  const Vector6d row = J.transpose() * slope;
  double sum_m2 = 0.0;
  for (std::size_t a = 0; a < 6; ++a) {
    for (std::size_t b = 0; b < 6; ++b) {
      sum_m2 += scale * row(static_cast<Eigen::Index>(a)) * row(static_cast<Eigen::Index>(b)) *
                covariance_(std::max(index[a], index[b]), std::min(index[a], index[b]));
    }
  }
  return sum_m2;
}

}  // namespace situation_awareness

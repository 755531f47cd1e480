// SPDX-License-Identifier: BSD-3-Clause
#include "situation_awareness/registration/pose_graph.hpp"

#include <algorithm>
#include <cmath>
#include <vector>

#include <Eigen/Cholesky>

#include "situation_awareness/common/time.hpp"
#include "situation_awareness/geometry/vectors.hpp"

namespace situation_awareness {
namespace {

/// s. Poses of the latest time are all kept. Of older ones their distance is at most this part of their age beyond it:
/// the motion changes slowly between what was drawn long ago.
constexpr double kAll_s = 48.0, kApart = 1.0 / 12.0;
/// s. For so long at least.
constexpr double kKept_s = 1500.0;
/// Random walk of the motion from a pose to the next by inertial navigation (m / sqrt(s), rad / sqrt(s)).
constexpr double kDrift_m_sqrt_s = 0.1, kDrift_rad_sqrt_s = 0.01;
/// Of the first pose, which stays (1 / m^2, 1 / rad^2).
constexpr double kAnchor = 1e9;

/// The motion about a place by that about the map's origin.
Eigen::Matrix3d about(const Eigen::Vector2d& p_map_m) {
  Eigen::Matrix3d J = Eigen::Matrix3d::Identity();
  J.topRightCorner<2, 1>() = left_of(p_map_m);
  return J;
}

}  // namespace

PoseGraph::PoseGraph() {
  nodes_.reserve(kMostPoses);
  constexpr auto kUnknowns = static_cast<Eigen::Index>(3 * kMostPoses);
  H_.setZero(kUnknowns, kUnknowns);
  factor_.setZero(kUnknowns, kUnknowns);
  b_.setZero(kUnknowns);
  x_.setZero(kUnknowns);
}

bool PoseGraph::is_due(std::int64_t stamp_ns) const {
  return nodes_.empty() || seconds_between(nodes_.back().stamp_ns, stamp_ns) >= kPeriod_s;
}

void PoseGraph::add(std::int64_t stamp_ns, const Eigen::Vector2d& p_map_m) {
  while (nodes_.size() > 1 &&
         (nodes_.size() == kMostPoses || seconds_between(nodes_[1].stamp_ns, stamp_ns) > kKept_s)) {
    remove(0);  // its motion is none
  }
  thin_out();
  Node node;
  node.stamp_ns = stamp_ns;
  node.p_map_m = p_map_m;
  nodes_.push_back(node);
  H_.middleRows<3>(unknowns() - 3).leftCols(unknowns()).setZero();
  H_.middleCols<3>(unknowns() - 3).topRows(unknowns()).setZero();
  b_.segment<3>(unknowns() - 3).setZero();
  if (nodes_.size() == 1) return;
  const Node& last = nodes_[nodes_.size() - 2];
  const double dt_s = std::max(seconds_between(last.stamp_ns, stamp_ns), 1e-3);
  const double m = kDrift_m_sqrt_s, rad = kDrift_rad_sqrt_s;
  const Eigen::Vector3d variance = dt_s * Eigen::Vector3d(m, m, rad).cwiseAbs2();
  const Eigen::Matrix3d J = about(last.p_map_m);
  relate(nodes_.size() - 1, nodes_.size() - 2, J.transpose() * variance.cwiseInverse().asDiagonal() * J,
         Eigen::Vector3d::Zero());
}

void PoseGraph::thin_out() {
  for (std::size_t k = 1; k + 1 < nodes_.size();) {
    const double age_s = seconds_between(nodes_[k].stamp_ns, nodes_.back().stamp_ns);
    if (age_s < kAll_s) return;
    const bool is_dense = seconds_between(nodes_[k - 1].stamp_ns, nodes_[k + 1].stamp_ns) < kApart * (age_s - kAll_s);
    is_dense ? marginalize(k) : void(++k);
  }
}

/// The Schur complement of its unknowns.
void PoseGraph::marginalize(std::size_t node) {
  const auto at = static_cast<Eigen::Index>(3 * node);
  const Eigen::LLT<Eigen::Matrix3d> llt(H_.block<3, 3>(at, at));
  auto columns = factor_.topLeftCorner(unknowns(), 3);
  auto rows = factor_.middleCols<3>(3).topRows(unknowns());
  columns = H_.middleCols<3>(at).topRows(unknowns());
  for (Eigen::Index i = 0; i < unknowns(); ++i) {
    rows.row(i) = llt.solve(columns.row(i).transpose()).transpose();
  }
  b_.head(unknowns()).noalias() -= rows * b_.segment<3>(at).eval();
  for (Eigen::Index c = 0; c < unknowns(); ++c) {
    H_.col(c).head(unknowns()).noalias() -= rows * columns.row(c).transpose();
  }
  remove(node);
}

void PoseGraph::remove(std::size_t node) {
  const auto at = static_cast<Eigen::Index>(3 * node), after = unknowns() - at - 3;
  for (Eigen::Index c = 0; c < at + after; ++c) {
    const double* const from = H_.col(c < at ? c : c + 3).data();
    double* const to = H_.col(c).data();
    if (c >= at) std::copy(from, from + at, to);
    std::copy(from + at + 3, from + at + 3 + after, to + at);
  }
  std::copy(b_.data() + at + 3, b_.data() + at + 3 + after, b_.data() + at);
  nodes_.erase(nodes_.begin() + static_cast<std::ptrdiff_t>(node));
}

std::vector<PoseGraph::Node>::const_iterator PoseGraph::first_since(std::int64_t stamp_ns) const {
  return std::lower_bound(nodes_.begin(), nodes_.end(), stamp_ns,
                          [](const Node& node, std::int64_t ns) { return node.stamp_ns < ns; });
}

/// The pose nearest in time.
std::size_t PoseGraph::nearest(std::int64_t drawn_ns) const {
  auto after = first_since(drawn_ns);
  if (after == nodes_.end()) --after;
  if (after != nodes_.begin() && drawn_ns - (after - 1)->stamp_ns < after->stamp_ns - drawn_ns) --after;
  return static_cast<std::size_t>(after - nodes_.begin());
}

/// Of a pose to itself it counts for nothing.
void PoseGraph::relate(std::size_t node, std::size_t other, const Eigen::Matrix3d& A, const Eigen::Vector3d& b) {
  if (node == other) return;
  const auto i = static_cast<Eigen::Index>(3 * node), k = static_cast<Eigen::Index>(3 * other);
  H_.block<3, 3>(i, i) += A;
  H_.block<3, 3>(k, k) += A;
  H_.block<3, 3>(i, k) -= A;
  H_.block<3, 3>(k, i) -= A;
  b_.segment<3>(i) += b;
  b_.segment<3>(k) -= b;
}

void PoseGraph::tie(std::int64_t drawn_ns, const Eigen::Vector2d& p_map_m, const Eigen::Vector2d& normal_map,
                    double residual_m, double weight) {
  Eigen::Vector3d J;
  J << normal_map, normal_map.dot(left_of(p_map_m));
  relate(nodes_.size() - 1, nearest(drawn_ns), weight * J * J.transpose(), weight * residual_m * J);
}

void PoseGraph::tie(std::int64_t drawn_ns, const Eigen::Vector2d& center_m, const Eigen::Matrix3d& A,
                    const Eigen::Vector3d& b) {
  const Eigen::Matrix3d J = about(center_m);
  relate(nodes_.size() - 1, nearest(drawn_ns), J.transpose() * A * J, J.transpose() * b);
}

void PoseGraph::solve() {
  auto A = factor_.topLeftCorner(unknowns(), unknowns());
  A = H_.topLeftCorner(unknowns(), unknowns());
  A.diagonal().head<3>().array() += kAnchor;
  Eigen::Ref<Eigen::MatrixXd> in_place = A;
  const Eigen::LLT<Eigen::Ref<Eigen::MatrixXd>> llt(in_place);
  auto x = x_.head(unknowns());
  x = b_.head(unknowns());
  llt.solveInPlace(x);
  if (!x.allFinite()) x.setZero();
  for (std::size_t k = 0; k < nodes_.size(); ++k) nodes_[k].x = x.segment<3>(static_cast<Eigen::Index>(3 * k));
}

Pose2 PoseGraph::motion_of(std::int64_t drawn_ns) const {
  const auto after = first_since(drawn_ns);
  const Node& next = after == nodes_.end() ? nodes_.back() : *after;
  const Node& last = after == nodes_.begin() ? next : *(after - 1);
  const double period_s = seconds_between(last.stamp_ns, next.stamp_ns);
  const double part = period_s > 0.0 ? std::clamp(seconds_between(last.stamp_ns, drawn_ns) / period_s, 0.0, 1.0) : 1.0;
  const Eigen::Vector3d x = last.x + part * (next.x - last.x);
  // About the pose, as the linear motion is not one for places far away.
  const Eigen::Vector2d p_map_m = last.p_map_m + part * (next.p_map_m - last.p_map_m);
  return motion_about(p_map_m, about(p_map_m) * x);
}

void PoseGraph::move() {
  b_.head(unknowns()).noalias() -= H_.topLeftCorner(unknowns(), unknowns()) * x_.head(unknowns());
  for (Node& node : nodes_) {
    node.p_map_m += (about(node.p_map_m) * node.x).head<2>();
    node.x.setZero();
  }
}

}  // namespace situation_awareness

// SPDX-License-Identifier: BSD-3-Clause
#include "situation_awareness/pipeline/pose_graph.hpp"

#include <algorithm>
#include <cmath>
#include <vector>

#include <Eigen/SparseCholesky>

#include "situation_awareness/common/time.hpp"
#include "situation_awareness/geometry/vectors.hpp"

namespace situation_awareness {
namespace {

/// Half an hour, and what their ties usually need.
constexpr std::size_t kMostPoses = 1800, kUsualTies = 16 * kMostPoses;
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
  ties_.reserve(kUsualTies);
}

bool PoseGraph::is_due(std::int64_t stamp_ns) const {
  return nodes_.empty() || seconds_between(nodes_.back().stamp_ns, stamp_ns) >= kPeriod_s;
}

void PoseGraph::add(std::int64_t stamp_ns, const Eigen::Vector2d& p_map_m) {
  Node node;
  node.stamp_ns = stamp_ns;
  node.p_map_m = p_map_m;
  if (!nodes_.empty()) {
    const double dt_s = std::max(seconds_between(nodes_.back().stamp_ns, stamp_ns), 1e-3);
    const double m = kDrift_m_sqrt_s, rad = kDrift_rad_sqrt_s;
    const Eigen::Vector3d variance = dt_s * Eigen::Vector3d(m, m, rad).cwiseAbs2();
    const Eigen::Matrix3d J = about(nodes_.back().p_map_m);
    node.to_previous.A = J.transpose() * variance.cwiseInverse().asDiagonal() * J;
  }
  if (nodes_.size() == kMostPoses) forget_older_half();
  nodes_.push_back(node);
}

void PoseGraph::forget_older_half() {
  nodes_.erase(nodes_.begin(), nodes_.begin() + kMostPoses / 2);
  first_ += kMostPoses / 2;
  ties_.erase(ties_.begin(),
              std::find_if(ties_.begin(), ties_.end(), [&](const Tie& tie) { return tie.node >= first_; }));
}

std::vector<PoseGraph::Node>::const_iterator PoseGraph::first_since(std::int64_t stamp_ns) const {
  return std::lower_bound(nodes_.begin(), nodes_.end(), stamp_ns,
                          [](const Node& node, std::int64_t ns) { return node.stamp_ns < ns; });
}

/// To the pose nearest in time; of the pose added last to itself, one that counts for nothing.
PoseGraph::Relation& PoseGraph::relation_to(std::int64_t drawn_ns) {
  auto after = first_since(drawn_ns);
  if (after == nodes_.end()) --after;
  if (after != nodes_.begin() && drawn_ns - (after - 1)->stamp_ns < after->stamp_ns - drawn_ns) --after;
  const std::size_t other = first_ + static_cast<std::size_t>(after - nodes_.begin());
  const std::size_t node = first_ + nodes_.size() - 1;
  for (auto tie = ties_.rbegin(); tie != ties_.rend() && tie->node == node; ++tie) {
    if (tie->other == other) return tie->relation;
  }
  ties_.push_back({node, other, {}});
  return ties_.back().relation;
}

void PoseGraph::tie(std::int64_t drawn_ns, const Eigen::Vector2d& p_map_m, const Eigen::Vector2d& normal_map,
                    double residual_m, double weight) {
  Relation& relation = relation_to(drawn_ns);
  Eigen::Vector3d J;
  J << normal_map, normal_map.dot(left_of(p_map_m));
  relation.A += weight * J * J.transpose();
  relation.b += weight * residual_m * J;
}

void PoseGraph::tie(std::int64_t drawn_ns, const Eigen::Vector2d& center_m, const Eigen::Matrix3d& A,
                    const Eigen::Vector3d& b) {
  Relation& relation = relation_to(drawn_ns);
  const Eigen::Matrix3d J = about(center_m);
  relation.A += J.transpose() * A * J;
  relation.b += J.transpose() * b;
}

void PoseGraph::solve() {
  using Sparse = Eigen::SparseMatrix<double>;
  const auto size = static_cast<Eigen::Index>(3 * nodes_.size());
  std::vector<Eigen::Triplet<double>> entries;
  Eigen::VectorXd b = Eigen::VectorXd::Zero(size);
  const auto add = [&](std::size_t row, std::size_t column, const Eigen::Matrix3d& block, double sign) {
    for (int r = 0; r < 3; ++r) {
      for (int c = 0; c < 3; ++c) {
        entries.emplace_back(static_cast<int>(3 * row) + r, static_cast<int>(3 * column) + c, sign * block(r, c));
      }
    }
  };
  const auto relate = [&](std::size_t node, std::size_t other, const Relation& relation) {
    if (node == other) return;
    add(node, node, relation.A, 1.0);
    add(other, other, relation.A, 1.0);
    add(node, other, relation.A, -1.0);
    add(other, node, relation.A, -1.0);
    b.segment<3>(static_cast<Eigen::Index>(3 * node)) += relation.b;
    b.segment<3>(static_cast<Eigen::Index>(3 * other)) -= relation.b;
  };
  add(0, 0, Eigen::Matrix3d::Identity(), kAnchor);
  for (std::size_t k = 1; k < nodes_.size(); ++k) relate(k, k - 1, nodes_[k].to_previous);
  for (const Tie& tie : ties_) relate(index_of(tie.node), index_of(tie.other), tie.relation);
  Sparse A(size, size);
  A.setFromTriplets(entries.begin(), entries.end());
  const Eigen::VectorXd x = Eigen::SimplicialLDLT<Sparse>(A).solve(b);
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
  for (std::size_t k = nodes_.size(); k-- > 1;) {
    nodes_[k].to_previous.b -= nodes_[k].to_previous.A * (nodes_[k].x - nodes_[k - 1].x);
  }
  for (Tie& tie : ties_) {
    tie.relation.b -= tie.relation.A * (nodes_[index_of(tie.node)].x - nodes_[index_of(tie.other)].x);
  }
  for (Node& node : nodes_) {
    node.p_map_m += (about(node.p_map_m) * node.x).head<2>();
    node.x.setZero();
  }
}

}  // namespace situation_awareness

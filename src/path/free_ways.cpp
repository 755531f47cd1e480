// SPDX-License-Identifier: BSD-3-Clause
#include "situation_awareness/path/free_ways.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <queue>
#include <stdexcept>
#include <string>
#include <utility>

#include "situation_awareness/geometry/curve.hpp"

namespace situation_awareness {
namespace {

constexpr double kDiagonal = 1.4142135623730951;
constexpr double kBlocked = std::numeric_limits<double>::infinity();
constexpr double kMostNodes = 1e6;
constexpr std::size_t kMostFields = 400;  ///< goals whose lengths are remembered
constexpr int kEntryNodes = 3;            ///< a way leaves its begin to a node that is so many steps away at most
constexpr std::array<std::array<int, 2>, 4> kEdges{{{1, 0}, {1, 1}, {0, 1}, {-1, 1}}};

/// Whether a line keeps its margin from all pieces; from those to which it begins nearer, this distance.
bool keeps_away(const Curve& line, const Eigen::Vector2d& from_m, const Obstacles& obstacles,
                const AvoidanceParams& params) {
  const Eigen::Vector2d middle_m = point_at(line, 0.5 * line.length_m);
  const double most_m = params.clearance_m;
  for (const PieceRun& run : obstacles.runs()) {
    const double reach_m = 0.5 * line.length_m + run.radius_m + most_m + params.sigmas * run.sigma_m;
    if ((middle_m - run.middle_m).norm() >= reach_m) continue;
    for (std::size_t i = run.first; i < run.end; ++i) {
      const ObstaclePiece& piece = obstacles.pieces()[i];
      const double margin = margin_m(piece, 0.0, params);
      if ((middle_m - piece.middle_m).norm() - 0.5 * line.length_m - piece.half_m >= margin) continue;
      const double begin_m = distance_m(piece.curve, from_m);
      if (distance_m(line, piece.curve) < std::min(margin, begin_m) - 1e-9) return false;
    }
  }
  return true;
}

}  // namespace

FreeWays::FreeWays(const Eigen::Vector2d& low_world_m, const Eigen::Vector2d& high_world_m, double step_m)
    : low_m_(low_world_m), step_m_(step_m) {
  const Eigen::Vector2d size_m = high_world_m - low_world_m;
  if (!(size_m.minCoeff() > 0.0) || !(step_m > 0.0) || !size_m.allFinite() ||
      (size_m.x() / step_m + 2.0) * (size_m.y() / step_m + 2.0) > kMostNodes) {
    throw std::invalid_argument("free ways need a rectangle and a step, with at most 1e6 nodes");
  }
  columns_ = static_cast<std::size_t>(std::ceil(size_m.x() / step_m)) + 1;
  rows_ = static_cast<std::size_t>(std::ceil(size_m.y() / step_m)) + 1;
}

void FreeWays::set(const Obstacles& obstacles, const AvoidanceParams& params) {
  obstacles_ = obstacles;
  params_ = params;
  fields_.clear();
  free_.assign(columns_ * rows_, 1);
  edges_.assign(columns_ * rows_, 0);
  if (obstacles_.pieces().empty()) return;
  for (std::size_t node = 0; node < free_.size(); ++node) free_[node] = is_free(node_m(node)) ? 1 : 0;
  for (std::size_t row = 0; row < rows_; ++row) {
    for (std::size_t column = 0; column < columns_; ++column) {
      const std::size_t node = row * columns_ + column;
      if (free_[node] == 0) continue;
      for (std::size_t k = 0; k < kEdges.size(); ++k) {
        const auto c = static_cast<std::ptrdiff_t>(column) + kEdges[k][0];
        const std::size_t r = row + static_cast<std::size_t>(kEdges[k][1]);
        if (c < 0 || c >= static_cast<std::ptrdiff_t>(columns_) || r >= rows_) continue;
        const std::size_t other = r * columns_ + static_cast<std::size_t>(c);
        if (free_[other] == 0 || !is_free(node_m(node), node_m(other))) continue;
        edges_[node] = static_cast<std::uint8_t>(edges_[node] | (1U << k));
      }
    }
  }
}

Eigen::Vector2d FreeWays::node_m(std::size_t node) const {
  return low_m_ + step_m_ * Eigen::Vector2d(static_cast<double>(node % columns_), static_cast<double>(node / columns_));
}

bool FreeWays::is_free(const Eigen::Vector2d& p_world_m) const {
  for (const PieceRun& run : obstacles_.runs()) {
    const double reach_m = run.radius_m + params_.clearance_m + params_.sigmas * run.sigma_m;
    if ((p_world_m - run.middle_m).norm() >= reach_m) continue;
    for (std::size_t i = run.first; i < run.end; ++i) {
      const ObstaclePiece& piece = obstacles_.pieces()[i];
      if (distance_m(piece.curve, p_world_m) < margin_m(piece, 0.0, params_)) return false;
    }
  }
  return true;
}

bool FreeWays::is_free(const Eigen::Vector2d& from_world_m, const Eigen::Vector2d& to_world_m) const {
  if (obstacles_.pieces().empty() || (to_world_m - from_world_m).norm() < 1e-6) return true;
  return keeps_away(straight_curve(from_world_m, to_world_m), from_world_m, obstacles_, params_);
}

std::vector<std::size_t> FreeWays::nodes_near(const Eigen::Vector2d& p_m) const {
  std::vector<std::size_t> nodes;
  const Eigen::Vector2d at = (p_m - low_m_) / step_m_;
  const auto column = static_cast<std::ptrdiff_t>(std::lround(std::clamp(at.x(), -1e6, 1e6)));
  const auto row = static_cast<std::ptrdiff_t>(std::lround(std::clamp(at.y(), -1e6, 1e6)));
  for (std::ptrdiff_t r = row - kEntryNodes; r <= row + kEntryNodes; ++r) {
    for (std::ptrdiff_t c = column - kEntryNodes; c <= column + kEntryNodes; ++c) {
      if (r < 0 || c < 0 || r >= static_cast<std::ptrdiff_t>(rows_) || c >= static_cast<std::ptrdiff_t>(columns_)) {
        continue;
      }
      const std::size_t node = static_cast<std::size_t>(r) * columns_ + static_cast<std::size_t>(c);
      if (free_[node] != 0) nodes.push_back(node);
    }
  }
  return nodes;
}

/// Dijkstra's algorithm from the goal.
const FreeWays::Field& FreeWays::field_to(const Eigen::Vector2d& goal_m) {
  const std::pair<double, double> key(goal_m.x(), goal_m.y());
  const auto found = fields_.find(key);
  if (found != fields_.end()) return found->second;
  if (fields_.size() >= kMostFields) fields_.clear();
  Field& field = fields_[key];
  field.length_m.assign(free_.size(), kBlocked);
  field.next.assign(free_.size(), kNone);
  using Entry = std::pair<double, std::size_t>;
  std::priority_queue<Entry, std::vector<Entry>, std::greater<>> open;
  for (const std::size_t node : nodes_near(goal_m)) {
    if (!is_free(node_m(node), goal_m)) continue;
    field.length_m[node] = (node_m(node) - goal_m).norm();
    open.emplace(field.length_m[node], node);
  }
  while (!open.empty()) {
    const auto [length_m, node] = open.top();
    open.pop();
    if (length_m > field.length_m[node]) continue;
    const std::size_t column = node % columns_, row = node / columns_;
    for (std::size_t k = 0; k < 2 * kEdges.size(); ++k) {
      const std::array<int, 2>& edge = kEdges[k % kEdges.size()];
      const int sign = k < kEdges.size() ? 1 : -1;
      const auto c = static_cast<std::ptrdiff_t>(column) + sign * edge[0];
      const auto r = static_cast<std::ptrdiff_t>(row) + sign * edge[1];
      if (r < 0 || c < 0 || r >= static_cast<std::ptrdiff_t>(rows_) || c >= static_cast<std::ptrdiff_t>(columns_)) {
        continue;
      }
      const std::size_t other = static_cast<std::size_t>(r) * columns_ + static_cast<std::size_t>(c);
      const std::size_t owner = sign > 0 ? node : other;
      if ((edges_[owner] >> (k % kEdges.size()) & 1U) == 0) continue;
      const double through_m = length_m + (edge[0] != 0 && edge[1] != 0 ? kDiagonal : 1.0) * step_m_;
      if (through_m >= field.length_m[other]) continue;
      field.length_m[other] = through_m;
      field.next[other] = node;
      open.emplace(through_m, other);
    }
  }
  return field;
}

std::size_t FreeWays::entry(const Eigen::Vector2d& from_m, const Field& field, double& length_m) const {
  std::size_t best = kNone;
  length_m = kBlocked;
  for (const std::size_t node : nodes_near(from_m)) {
    const double through_m = (node_m(node) - from_m).norm() + field.length_m[node];
    if (through_m >= length_m || !is_free(from_m, node_m(node))) continue;
    best = node;
    length_m = through_m;
  }
  return best;
}

double FreeWays::length_m(const Eigen::Vector2d& from_world_m, const Eigen::Vector2d& to_world_m) {
  if (is_free(from_world_m, to_world_m)) return (to_world_m - from_world_m).norm();
  double length_m = kBlocked;
  entry(from_world_m, field_to(to_world_m), length_m);
  return length_m;
}

std::vector<Eigen::Vector2d> FreeWays::way(const Eigen::Vector2d& from_world_m, const Eigen::Vector2d& to_world_m) {
  if (is_free(from_world_m, to_world_m)) return {to_world_m};
  const Field& field = field_to(to_world_m);
  double length_m = kBlocked;
  std::vector<Eigen::Vector2d> corners;
  for (std::size_t node = entry(from_world_m, field, length_m); node != kNone; node = field.next[node]) {
    corners.push_back(node_m(node));
  }
  if (corners.empty()) return {};
  corners.push_back(to_world_m);
  // Straight from each corner to the last that is free from there.
  std::vector<Eigen::Vector2d> straight;
  Eigen::Vector2d at_m = from_world_m;
  for (std::size_t i = 0; i < corners.size();) {
    std::size_t last = i;
    for (std::size_t k = corners.size(); k-- > i + 1;) {
      if (!is_free(at_m, corners[k])) continue;
      last = k;
      break;
    }
    straight.push_back(corners[last]);
    at_m = corners[last];
    i = last + 1;
  }
  return straight;
}

}  // namespace situation_awareness

// SPDX-License-Identifier: BSD-3-Clause
#include "situation_awareness/map/polygons/chain_links.hpp"

#include <algorithm>
#include <cmath>
#include <limits>

#include "situation_awareness/common/usual_room.hpp"

namespace situation_awareness {
namespace {

using Index = Surfels::Index;
constexpr Index kNone = Surfels::kNone;
constexpr double kNoLink = std::numeric_limits<double>::infinity();

/// Reach of a link along a line, in parts of the spacing; beyond it there is a gap.
constexpr double kNextOne = 2.2;
/// Elements nearer to each other along the line, in the same parts, lie beside each other.
constexpr double kBeside = 0.1;
/// Offset across the line per length, and cosine between the normals: what bends more is a corner.
constexpr double kMaxBend = 0.45;
constexpr double kSameSurface = 0.7;
/// The same beyond a gap, in m.
constexpr double kStepBeyondGap_m = 0.012;
constexpr double kSameLine = 0.95;
constexpr double kTurnBeyondGap = 0.05;
/// The direction of a chain's end is that of so many elements, if they are so long.
constexpr int kEndElements = 4;
constexpr double kLeastEnd_m = 0.05;
/// Offsets across cost so much more than the way along, if they are more than this (m).
constexpr double kAcrossCost = 6.0;
constexpr double kRough_m = 0.006;
/// Sine between two lines that meet in a corner, at least.
constexpr double kCorner = 0.3;
/// m. From the hits on a corner's sides to the corner: of an outer one, beside which beams may be lost; and of an inner
/// one, where a thing that stands near a wall does not touch it.
constexpr double kAheadOuter_m = 0.06;
constexpr double kAheadInner_m = 0.015;
/// The same of two walls, in whose corner few hits tell which one they are of; and the elements of a wall.
constexpr double kAheadWalls_m = 0.06;
constexpr int kWall = 25;
/// The same, as a multiple, where both sides were of one chain before.
constexpr double kKnownReach = 2.5;
/// m. The same beyond the corner, where noise put an element there.
constexpr double kBack_m = 0.04;
/// m. An element so near to a link is on it.
constexpr double kOnLine_m = 0.012;
/// Distance of two ends that are joined however their lines meet, in the same parts.
constexpr double kTouch = 1.8;
/// Searches for the best one that has not found a better one.
constexpr int kRounds = 3;

double sigma_of(const Surfel& surfel) { return std::sqrt(surfel.variance_m2); }

/// Towards the free side, of a boundary that runs so.
Eigen::Vector2d normal_of(const Eigen::Vector2d& along) { return {-along.y(), along.x()}; }

/// Of going on from `right` to the next one on its line.
double next_cost(const Surfel& right, const Surfel& left, double spacing_m) {
  const Eigen::Vector2d d_m = left.p_world_m - right.p_world_m;
  const double along_m = right.along_world().dot(d_m);
  if (along_m < kBeside * spacing_m || along_m > kNextOne * spacing_m || left.along_world().dot(d_m) <= 0.0) {
    return kNoLink;
  }
  if (right.normal_world.dot(left.normal_world) < kSameSurface) return kNoLink;
  const double off_m = std::abs(right.normal_world.dot(d_m)), back_off_m = std::abs(left.normal_world.dot(d_m));
  const double most_m = 2.0 * (sigma_of(right) + sigma_of(left)) + kMaxBend * along_m + kRough_m;
  if (std::max(off_m, back_off_m) > most_m) return kNoLink;
  return along_m + kAcrossCost * (std::max(off_m - kRough_m, 0.0) + std::max(back_off_m - kRough_m, 0.0));
}

/// Of going on beyond a gap, from the end of a chain that runs along `t_right` to the beginning of one that runs along
/// `t_left`.
double gap_cost(const Surfel& right, const Eigen::Vector2d& t_right, const Surfel& left, const Eigen::Vector2d& t_left,
                double max_gap_m) {
  const Eigen::Vector2d d_m = left.p_world_m - right.p_world_m;
  const double along_m = t_right.dot(d_m);
  if (along_m <= 0.0 || along_m > max_gap_m || t_left.dot(d_m) <= 0.0 || t_right.dot(t_left) < kSameLine) {
    return kNoLink;
  }
  const double off_m = std::abs(normal_of(t_right).dot(d_m)), back_off_m = std::abs(normal_of(t_left).dot(d_m));
  const double most_m = 2.0 * (sigma_of(right) + sigma_of(left)) + kStepBeyondGap_m + kTurnBeyondGap * along_m;
  if (std::max(off_m, back_off_m) > most_m) return kNoLink;
  return along_m + kAcrossCost * (std::max(off_m - kRough_m, 0.0) + std::max(back_off_m - kRough_m, 0.0));
}

/// The same around a corner.
double corner_cost(const Surfel& right, const Eigen::Vector2d& t_right, const Surfel& left,
                   const Eigen::Vector2d& t_left, double spacing_m, bool are_walls) {
  const Eigen::Vector2d d_m = left.p_world_m - right.p_world_m;
  const double sine = t_right.x() * t_left.y() - t_right.y() * t_left.x();
  if (std::abs(sine) > kCorner) {
    const double ahead_m = (d_m.x() * t_left.y() - d_m.y() * t_left.x()) / sine - right.high_m;
    const double back_m = left.low_m - (d_m.x() * t_right.y() - d_m.y() * t_right.x()) / sine;
    const double same = right.chain == left.chain && right.chain != 0 ? kKnownReach : 1.0;
    const double most_m = are_walls ? kAheadWalls_m : same * (sine < 0.0 ? kAheadOuter_m : kAheadInner_m);
    const double least_m = -kBack_m - right.high_m;
    if (ahead_m > least_m && ahead_m < most_m && back_m > least_m && back_m < most_m) {
      return std::abs(ahead_m) + std::abs(back_m);
    }
    // Noise at the corner of two walls turns their last elements.
    return are_walls && d_m.norm() < kAheadWalls_m ? 4.0 * kAheadWalls_m + d_m.norm() : kNoLink;
  }
  const double gap = d_m.norm() / spacing_m;
  const bool goes_on = are_walls || (t_right.dot(d_m) >= 0.0 && t_left.dot(d_m) >= 0.0);
  return gap < kTouch && goes_on ? gap * spacing_m + 2.0 * kAheadOuter_m : kNoLink;
}

}  // namespace

/// To an element that is on its line by the spacing along it and less across it.
double ChainLinks::reach_m(double spacing_m) { return std::sqrt(2.0) * kNextOne * spacing_m; }

/// Links those that are each other's best, and then those of the rest that are. search(i, act): act(j) for all that may
/// be.
template <class Search, class Cost>
void ChainLinks::link_best(const Search& search, const Cost& cost) {
  for (int round = 0; round < kRounds; ++round) {
    for (const Index i : open_) {
      const auto k = static_cast<std::size_t>(i);
      best_right_[k] = best_left_[k] = kNone;
      cost_right_[k] = cost_left_[k] = kNoLink;
    }
    for (const Index i : open_) {
      if (left_[static_cast<std::size_t>(i)] != kNone) continue;
      search(i, [&](Index j) {
        if (j == i || !links_[static_cast<std::size_t>(j)] || right_[static_cast<std::size_t>(j)] != kNone) return;
        const double value = cost(i, j);
        const auto better = [&](double than, Index current, Index by) {
          return value < than || (value == than && value < kNoLink && by < current);
        };
        const auto r = static_cast<std::size_t>(i), l = static_cast<std::size_t>(j);
        if (better(cost_left_[r], best_left_[r], j)) cost_left_[r] = value, best_left_[r] = j;
        if (better(cost_right_[l], best_right_[l], i)) cost_right_[l] = value, best_right_[l] = i;
      });
    }
    bool any = false;
    for (const Index i : open_) {
      const Index j = best_left_[static_cast<std::size_t>(i)];
      if (j == kNone || best_right_[static_cast<std::size_t>(j)] != i) continue;
      left_[static_cast<std::size_t>(i)] = j;
      right_[static_cast<std::size_t>(j)] = i;
      any = true;
    }
    open_.erase(std::remove_if(open_.begin(), open_.end(),
                               [&](Index i) {
                                 return left_[static_cast<std::size_t>(i)] != kNone &&
                                        right_[static_cast<std::size_t>(i)] != kNone;
                               }),
                open_.end());
    if (!any) return;
  }
}

void ChainLinks::link(const Surfels& surfels, const std::vector<Index>& elements, const NearElements& near,
                      double spacing_m, double max_gap_m) {
  const auto size = static_cast<std::size_t>(surfels.end());
  for (std::vector<Index>* list : {&right_, &left_, &best_right_, &best_left_}) assign_with_room(*list, size, kNone);
  assign_with_room(run_, size, 0);
  assign_with_room(along_, size, Eigen::Vector2d::UnitX());
  for (std::vector<double>* list : {&cost_right_, &cost_left_}) assign_with_room(*list, size, kNoLink);
  links_.assign(size, false);
  for (const Index i : elements) links_[static_cast<std::size_t>(i)] = true;
  // Ends of chains that are taken apart come back: room for all.
  for (std::vector<Index>* list : {&open_, &crossed_, &ordered_}) {
    if (list->capacity() < 2 * size) list->reserve(3 * size + kUsualRoom);
  }
  chains_.reserve(kUsualRoom);
  open_.assign(elements.begin(), elements.end());
  link_best([&](Index i, const auto& act) { near.for_each(i, act); },
            [&](Index right, Index left) { return next_cost(surfels[right], surfels[left], spacing_m); });
  leave_out_crossed(surfels, near, spacing_m);
  find_directions(surfels);
  const auto along = [&](Index i) -> const Eigen::Vector2d& { return along_[static_cast<std::size_t>(i)]; };
  // Only ends are left to be linked.
  const double corner_m = kKnownReach * kAheadOuter_m + spacing_m;
  near_ends_.find(surfels, open_, std::sqrt(2.0) * std::max(max_gap_m, corner_m));
  const auto within = [&](double radius_m) {
    return [&, most_m2 = 2.0 * radius_m * radius_m](Index i, const auto& act) {
      near_ends_.for_each(i, [&](Index j) {
        if ((surfels[j].p_world_m - surfels[i].p_world_m).squaredNorm() <= most_m2) act(j);
      });
    };
  };
  link_best(within(max_gap_m), [&](Index right, Index left) {
    return gap_cost(surfels[right], along(right), surfels[left], along(left), max_gap_m);
  });
  link_best(within(corner_m), [&](Index right, Index left) {
    return corner_cost(surfels[right], along(right), surfels[left], along(left), spacing_m,
                       std::min(run_[static_cast<std::size_t>(right)], run_[static_cast<std::size_t>(left)]) >= kWall);
  });
  walk(surfels, elements);
}

/// Of the ends of chains: where their last elements lie says more than how each is turned.
void ChainLinks::find_directions(const Surfels& surfels) {
  for (const Index i : open_) {
    const auto k = static_cast<std::size_t>(i);
    // Inwards: an end goes on at one of its sides only.
    const bool is_left_end = right_[k] != kNone;
    const std::vector<Index>& inwards = is_left_end ? right_ : left_;
    Index inner = i, direction = i;
    for (run_[k] = 1; run_[k] < kWall && inwards[static_cast<std::size_t>(inner)] != kNone; ++run_[k]) {
      inner = inwards[static_cast<std::size_t>(inner)];
      if (run_[k] <= kEndElements) direction = inner;
    }
    const Index right = is_left_end ? direction : i, left = is_left_end ? i : direction;
    const Eigen::Vector2d way_m = surfels[left].p_world_m - surfels[right].p_world_m;
    along_[k] = way_m.norm() > kLeastEnd_m ? Eigen::Vector2d(way_m.normalized()) : surfels[i].along_world();
  }
}

/// What lies on a boundary and faces another way is no surface: hits beside an edge that were taken for its side.
void ChainLinks::leave_out_crossed(const Surfels& surfels, const NearElements& near, double spacing_m) {
  crossed_.clear();
  for (std::size_t k = 0; k < links_.size(); ++k) {
    const Index i = static_cast<Index>(k);
    if (!links_[k] || left_[k] == kNone) continue;
    const Surfel& right = surfels[i];
    const Surfel& left = surfels[left_[k]];
    const Eigen::Vector2d way_m = left.p_world_m - right.p_world_m;
    const double length_m = way_m.norm();
    if (length_m > kNextOne * spacing_m) continue;
    near.for_each(i, [&](Index j) {
      if (j == left_[k] || !links_[static_cast<std::size_t>(j)]) return;
      const Surfel& other = surfels[j];
      if (std::abs(other.normal_world.dot(right.normal_world)) > kSameSurface) return;
      const double part = way_m.dot(other.p_world_m - right.p_world_m) / (length_m * length_m);
      if (part < 0.0 || part > 1.0) return;
      if ((other.p_world_m - right.p_world_m - part * way_m).norm() < kOnLine_m) crossed_.push_back(j);
    });
  }
  for (const Index j : crossed_) {
    const auto k = static_cast<std::size_t>(j);
    if (!links_[k]) continue;
    links_[k] = false;
    if (right_[k] != kNone) left_[static_cast<std::size_t>(right_[k])] = kNone, open_.push_back(right_[k]);
    if (left_[k] != kNone) right_[static_cast<std::size_t>(left_[k])] = kNone, open_.push_back(left_[k]);
    right_[k] = left_[k] = kNone;
  }
  std::sort(open_.begin(), open_.end());
  open_.erase(std::unique(open_.begin(), open_.end()), open_.end());
  open_.erase(std::remove_if(open_.begin(), open_.end(), [&](Index i) { return !links_[static_cast<std::size_t>(i)]; }),
              open_.end());
}

void ChainLinks::walk_from(const Surfels& surfels, Index first, bool closed) {
  const std::size_t begin = ordered_.size();
  for (Index i = first; i != kNone && !walked_[static_cast<std::size_t>(i)]; i = left_[static_cast<std::size_t>(i)]) {
    walked_[static_cast<std::size_t>(i)] = true;
    ordered_.push_back(i);
  }
  const std::size_t count = ordered_.size() - begin;
  if (!closed && count >= 4U * kWall) {  // the corner of two walls
    closed = (surfels[ordered_.back()].p_world_m - surfels[ordered_[begin]].p_world_m).norm() < kAheadWalls_m;
  }
  constexpr std::size_t kFewestOfClosed = 3;
  chains_.push_back({begin, ordered_.size(), closed && count >= kFewestOfClosed});
}

void ChainLinks::walk(const Surfels& surfels, const std::vector<Index>& elements) {
  ordered_.clear();
  chains_.clear();
  walked_.assign(links_.size(), false);
  for (const Index i : elements) {
    if (links_[static_cast<std::size_t>(i)] && right_[static_cast<std::size_t>(i)] == kNone)
      walk_from(surfels, i, false);
  }
  for (const Index i : elements) {
    if (links_[static_cast<std::size_t>(i)] && !walked_[static_cast<std::size_t>(i)]) walk_from(surfels, i, true);
  }
}

}  // namespace situation_awareness

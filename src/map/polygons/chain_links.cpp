// SPDX-License-Identifier: BSD-3-Clause
#include "situation_awareness/map/polygons/chain_links.hpp"

#include <algorithm>
#include <cmath>
#include <limits>

#include "situation_awareness/common/usual_room.hpp"
#include "situation_awareness/geometry/angles.hpp"

namespace situation_awareness {
namespace {

using Index = NearElements::Index;
constexpr Index kNone = Surfels::kNone;
constexpr double kNoLink = std::numeric_limits<double>::infinity();

/// Reach of a link along a line, in parts of the spacing; beyond it there is a gap.
constexpr double kNextOne = 2.2;
/// Elements nearer to each other along the line, in the same parts, lie beside each other.
constexpr double kBeside = 0.1;
/// Offset across the line per length, and cosine between the normals: what bends more is a corner.
constexpr double kMaxBend = 0.45;
constexpr double kSameSurface = LinkElement::kSameSurface;
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
/// m. From the hits on a corner's sides to the corner, at most: beams beside it may be lost, and hits in an inner one
/// are of either side.
constexpr double kAhead_m = 0.06;
/// m. The same beyond the corner, where noise put an element there. Of an inner corner: what is seen farther beyond it
/// is seen behind a thing that stands near a wall and does not touch it.
constexpr double kBeyond_m = 0.05, kBeyondInner_m = 0.035;
/// The same, as multiples, where both sides are of one chain already; and of the tolerance beyond a gap.
constexpr double kKnownAhead = 2.0, kKnownBeyond = 3.0, kKnownStep = 2.0;
/// Elements of a wall, at least: what is noise at a corner of two of them is known.
constexpr int kWall = 25;
/// m. An element so near to a link is on it.
constexpr double kOnLine_m = 0.012;
/// Distance of two ends that are joined however their lines meet, in the same parts.
constexpr double kTouch = 1.8;
/// Elements and size (m) of a chain of a small thing, at most, and the distance of two that are of one thing.
constexpr std::size_t kSmall = 8;
constexpr double kSmallSize_m = 0.16;
constexpr double kSameSmall_m = 0.06;
/// rad. Without elements on so much of its outline, seen from its middle, it is open.
constexpr double kOpenSmall_rad = 2.8;
/// m. Least distance of the elements of a small thing from its middle.
constexpr double kLeastRadius_m = 0.015;
/// m. Distance of beams that tell whether two chains meet, at most.
constexpr double kCloseBeams_joint_m = 0.1;
/// m. Ends of chains so near to each other meet, or do not.
constexpr double kNearEnds_m = 0.12;
/// Elements on a line, at most, that may be noise at a corner, and what it costs (m) to go on with them.
constexpr int kStray = 2;
constexpr double kStrayCost_m = 0.3;
/// m. Elements at this spacing or less have the lengths above around their corners and ends; others longer ones, in
/// proportion.
constexpr double kFineSpacing_m = 0.04;
/// Searches for the best one that has not found a better one.
constexpr int kRounds = 3;

/// Of lengths around corners and ends.
double coarseness(double spacing_m) { return std::max(1.0, spacing_m / kFineSpacing_m); }

/// Towards the free side, of a boundary that runs so.
Eigen::Vector2d normal_of(const Eigen::Vector2d& along) { return {-along.y(), along.x()}; }

/// Whether a boundary that runs along `t_right` and then along `t_left` turns to the free side.
bool is_inner(const Eigen::Vector2d& t_right, const Eigen::Vector2d& t_left) {
  return t_right.x() * t_left.y() - t_right.y() * t_left.x() > kCorner;
}

/// m. Diagonal of the box, along the axes of the world, around some of a list of elements.
double size_of(const std::vector<LinkElement>& elements, const std::vector<Index>& some, std::size_t first,
               std::size_t end) {
  const auto place_m = [&](std::size_t k) { return elements[static_cast<std::size_t>(some[k])].p_world_m; };
  Eigen::Vector2d low_m = place_m(first), high_m = low_m;
  for (std::size_t k = first; k < end; ++k) {
    low_m = low_m.cwiseMin(place_m(k));
    high_m = high_m.cwiseMax(place_m(k));
  }
  return (high_m - low_m).norm();
}

/// Of going on from `right` to the next one on its line.
double next_cost(const LinkElement& right, const LinkElement& left, double spacing_m) {
  const Eigen::Vector2d d_m = left.p_world_m - right.p_world_m;
  const double along_m = right.along_world().dot(d_m);
  const double off_m = std::abs(right.normal_world.dot(d_m)), back_off_m = std::abs(left.normal_world.dot(d_m));
  const double most_m = 2.0 * (right.sigma_m + left.sigma_m) + kMaxBend * along_m + kRough_m;
  // Few of the conditions can be predicted: no branch for each.
  const unsigned goes_on = static_cast<unsigned>(along_m >= kBeside * spacing_m) &
                           static_cast<unsigned>(along_m <= kNextOne * spacing_m) &
                           static_cast<unsigned>(left.along_world().dot(d_m) > 0.0) &
                           static_cast<unsigned>(right.normal_world.dot(left.normal_world) >= kSameSurface) &
                           static_cast<unsigned>(std::max(off_m, back_off_m) <= most_m);
  if (goes_on == 0U) return kNoLink;
  return along_m + kAcrossCost * (std::max(off_m - kRough_m, 0.0) + std::max(back_off_m - kRough_m, 0.0));
}

/// Of going on beyond a gap, from the end of a chain that runs along `t_right` to the beginning of one that runs along
/// `t_left`.
double gap_cost(const LinkElement& right, const Eigen::Vector2d& t_right, const LinkElement& left,
                const Eigen::Vector2d& t_left, double max_gap_m, bool is_known) {
  const Eigen::Vector2d d_m = left.p_world_m - right.p_world_m;
  const double along_m = t_right.dot(d_m);
  if (along_m <= 0.0 || along_m > max_gap_m || t_left.dot(d_m) <= 0.0 || t_right.dot(t_left) < kSameLine) {
    return kNoLink;
  }
  const double off_m = std::abs(normal_of(t_right).dot(d_m)), back_off_m = std::abs(normal_of(t_left).dot(d_m));
  const double most_m = (is_known ? kKnownStep : 1.0) *
                        (2.0 * (right.sigma_m + left.sigma_m) + kStepBeyondGap_m + kTurnBeyondGap * along_m);
  if (std::max(off_m, back_off_m) > most_m) return kNoLink;
  return along_m + kAcrossCost * (std::max(off_m - kRough_m, 0.0) + std::max(back_off_m - kRough_m, 0.0));
}

/// The same around a corner.
double corner_cost(const LinkElement& right, const Eigen::Vector2d& t_right, const LinkElement& left,
                   const Eigen::Vector2d& t_left, double spacing_m, bool are_walls, bool is_known) {
  const Eigen::Vector2d d_m = left.p_world_m - right.p_world_m;
  const double sine = t_right.x() * t_left.y() - t_right.y() * t_left.x();
  const double scale = coarseness(spacing_m);
  if (std::abs(sine) > kCorner) {
    const double ahead_m = (d_m.x() * t_left.y() - d_m.y() * t_left.x()) / sine - right.high_m;
    const double back_m = left.low_m - (d_m.x() * t_right.y() - d_m.y() * t_right.x()) / sine;
    const double most_m = (is_known ? kKnownAhead : 1.0) * scale * kAhead_m;
    const double least_m =
        -(is_known ? kKnownBeyond : 1.0) * scale * (sine < 0.0 || are_walls ? kBeyond_m : kBeyondInner_m);
    if (ahead_m > least_m && ahead_m < most_m && back_m > least_m && back_m < most_m) {
      return std::abs(ahead_m) + std::abs(back_m);
    }
    // Noise at the corner of two walls turns their last elements.
    return are_walls && d_m.norm() < scale * kAhead_m ? 4.0 * scale * kAhead_m + d_m.norm() : kNoLink;
  }
  const double gap = d_m.norm() / spacing_m;
  const bool goes_on = are_walls || (t_right.dot(d_m) >= 0.0 && t_left.dot(d_m) >= 0.0);
  return gap < kTouch && goes_on ? gap * spacing_m + 2.0 * scale * kAhead_m : kNoLink;
}

}  // namespace

/// To an element that is on its line by the spacing along it and less across it.
double ChainLinks::reach_m(double spacing_m) { return std::sqrt(2.0) * kNextOne * spacing_m; }

/// Links those that are each other's best, and then those of the rest that are. search(i, act): act(j) for all that may
/// be.
template <class Search, class Cost>
void ChainLinks::link_best(const Search& search, bool at_joints, const Cost& cost) {
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
        if (value == kNoLink) return;
        const auto better = [&](double than, Index current, Index by) {
          return value < than || (value == than && by < current);
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
      joint_[static_cast<std::size_t>(i)] = at_joints;
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

/// cost(right, left, is_known) of all ends of different chains, seen by this scan.
template <class Search, class Cost>
void ChainLinks::see_joints(const Elements& elements, const Search& search, const View& view, Joints& joints,
                            const Cost& cost) {
  for (const Index i : open_) {
    const auto r = static_cast<std::size_t>(i);
    if (left_[r] != kNone || name_[r] == 0 || run_[r] <= kStray) continue;
    search(i, [&](Index j) {
      const LinkElement &right = elements[r], &left = elements[static_cast<std::size_t>(j)];
      const auto l = static_cast<std::size_t>(j);
      if (j == i || !links_[l] || right_[l] != kNone || name_[l] == 0 || name_[l] == name_[r]) return;
      if (run_[l] <= kStray) return;
      if (!left.is_hit && !right.is_hit) return;
      if ((left.p_world_m - view.p_world_m).norm() * view.resolution_rad > kCloseBeams_joint_m) return;
      const bool meets = cost(i, j, false) < kNoLink;
      const bool is_near = (left.p_world_m - right.p_world_m).norm() < kNearEnds_m;
      if (meets || is_near || cost(i, j, true) < kNoLink) joints.see(name_[r], name_[l], meets);
    });
  }
}

void ChainLinks::link(const Elements& elements, const NearElements& near, double spacing_m, double max_gap_m,
                      const View& view, Joints& joints) {
  const std::size_t size = elements.size();
  const auto at = [&](Index i) -> const LinkElement& { return elements[static_cast<std::size_t>(i)]; };
  for (std::vector<Index>* list : {&right_, &left_, &best_right_, &best_left_}) assign_with_room(*list, size, kNone);
  assign_with_room(run_, size, 0);
  assign_with_room(along_, size, Eigen::Vector2d::UnitX());
  for (std::vector<double>* list : {&cost_right_, &cost_left_}) assign_with_room(*list, size, kNoLink);
  assign_with_room(name_, size, 0);
  for (std::vector<unsigned char>* list : {&links_, &joint_}) assign_with_room(*list, size, 0);
  // Ends of chains that are taken apart come back: room for all.
  for (std::vector<Index>* list : {&open_, &crossed_, &walked_in_order_}) {
    if (list->capacity() < 2 * size) list->reserve(3 * size + kUsualRoom);
  }
  chains_.reserve(kUsualRoom);
  open_.clear();
  for (std::size_t k = 0; k < size; ++k) {
    links_[k] = elements[k].is_shown && (!elements[k].is_kept || elements[k].is_context);
    if (links_[k]) open_.push_back(static_cast<Index>(k));
  }
  link_best([&](Index i, const auto& act) { near.for_each(i, act); }, false,
            [&](Index right, Index left) { return next_cost(at(right), at(left), spacing_m); });
  leave_out_crossed(elements, near, spacing_m);
  keep_lines(elements);
  assign_with_room(line_right_, size, kNone);
  assign_with_room(line_left_, size, kNone);
  std::copy(right_.begin(), right_.end(), line_right_.begin());
  std::copy(left_.begin(), left_.end(), line_left_.begin());
  find_directions(elements);

  const auto along = [&](Index i) -> const Eigen::Vector2d& { return along_[static_cast<std::size_t>(i)]; };
  const auto run = [&](Index i) { return run_[static_cast<std::size_t>(i)]; };
  const auto gap = [&](Index right, Index left, bool is_known) {
    return gap_cost(at(right), along(right), at(left), along(left), max_gap_m, is_known);
  };
  const auto corner = [&](Index right, Index left, bool is_known) {
    return corner_cost(at(right), along(right), at(left), along(left), spacing_m,
                       std::min(run(right), run(left)) >= kWall, is_known);
  };
  // Only ends are left to be linked.
  const double corner_m = kKnownAhead * coarseness(spacing_m) * kAhead_m + 2.0 * spacing_m;
  near_ends_.find(elements, open_, std::sqrt(2.0) * std::max(max_gap_m, corner_m));
  const auto within = [&](double radius_m) {
    return [&, most_m2 = 2.0 * radius_m * radius_m](Index i, const auto& act) {
      near_ends_.for_each(i, [&](Index j) {
        if ((at(j).p_world_m - at(i).p_world_m).squaredNorm() <= most_m2) act(j);
      });
    };
  };
  if (view.step_s > 0.0) {
    see_joints(elements, within(max_gap_m), view, joints, gap);
    see_joints(elements, within(corner_m), view, joints, corner);
    joints.decide(view.step_s);
  }
  const auto decided = [&](const auto& cost_of) {
    return [&](Index right, Index left) {
      const double stray_m = std::min(run(right), run(left)) <= kStray ? kStrayCost_m : 0.0;
      const auto cost = [&](Index r, Index l, bool is_known) { return cost_of(r, l, is_known) + stray_m; };
      const std::uint64_t a = name_[static_cast<std::size_t>(right)], b = name_[static_cast<std::size_t>(left)];
      const double known = cost(right, left, true);
      if (known == kNoLink || (a == b && a != 0)) return known;
      const double unknown = cost(right, left, false);
      const bool needs_proof = std::min(run(right), run(left)) < kWall && is_inner(along(right), along(left));
      if (a == 0 || b == 0) return needs_proof ? kNoLink : unknown;
      return joints.are_joined(a, b, !needs_proof && unknown < kNoLink) ? known : kNoLink;
    };
  };
  link_best(within(max_gap_m), true, decided(gap));
  link_best(within(corner_m), true, decided(corner));
  walk(elements, near);
}

/// Elements that are kept get the lines of before back, whatever the search gave them, and links to others that these
/// contradict are cut.
void ChainLinks::keep_lines(const Elements& elements) {
  bool any = false;
  for (std::size_t k = 0; k < elements.size(); ++k) {
    if (!elements[k].is_kept) continue;
    any = true;
    links_[k] = elements[k].is_linked;
    right_[k] = elements[k].right;
    left_[k] = elements[k].left;
  }
  if (!any) return;
  open_.clear();
  const auto are_linked = [&](Index right, Index left) {
    const auto r = static_cast<std::size_t>(right), l = static_cast<std::size_t>(left);
    return links_[r] && links_[l] && left_[r] == left && right_[l] == right;
  };
  for (std::size_t k = 0; k < elements.size(); ++k) {
    if (left_[k] != kNone && !are_linked(static_cast<Index>(k), left_[k])) left_[k] = kNone;
  }
  for (std::size_t k = 0; k < elements.size(); ++k) {
    if (right_[k] != kNone && !are_linked(right_[k], static_cast<Index>(k))) right_[k] = kNone;
    if (links_[k] && (left_[k] == kNone || right_[k] == kNone)) open_.push_back(static_cast<Index>(k));
  }
}

/// Of the ends of chains: where their last elements lie says more than how each is turned.
void ChainLinks::find_directions(const Elements& elements) {
  for (const Index i : open_) {
    const auto k = static_cast<std::size_t>(i);
    // Inwards: an end goes on at one of its sides only.
    const bool is_left_end = right_[k] != kNone;
    const std::vector<Index>& inwards = is_left_end ? right_ : left_;
    Index inner = i, direction = i;
    std::uint64_t name = elements[k].chain;  // of the majority (Boyer and Moore)
    int votes = 1;
    for (run_[k] = 1; run_[k] < kWall && inwards[static_cast<std::size_t>(inner)] != kNone; ++run_[k]) {
      inner = inwards[static_cast<std::size_t>(inner)];
      if (run_[k] <= kEndElements) direction = inner;
      const std::uint64_t other = elements[static_cast<std::size_t>(inner)].chain;
      if (other == 0) continue;
      if (votes == 0 || name == 0) name = other, votes = 0;
      votes += other == name ? 1 : -1;
    }
    name_[k] = name;
    const Eigen::Vector2d inwards_m = elements[static_cast<std::size_t>(direction)].p_world_m - elements[k].p_world_m;
    const Eigen::Vector2d way_m = is_left_end ? Eigen::Vector2d(-inwards_m) : inwards_m;
    along_[k] = way_m.norm() > kLeastEnd_m ? Eigen::Vector2d(way_m.normalized()) : elements[k].along_world();
  }
}

/// What lies on a boundary and faces another way is no surface: hits beside an edge that were taken for its side.
void ChainLinks::leave_out_crossed(const Elements& elements, const NearElements& near, double spacing_m) {
  crossed_.clear();
  for (std::size_t k = 0; k < links_.size(); ++k) {
    const Index i = static_cast<Index>(k);
    if (!links_[k] || left_[k] == kNone || !elements[k].is_crossed) continue;
    const LinkElement& right = elements[k];
    const LinkElement& left = elements[static_cast<std::size_t>(left_[k])];
    const Eigen::Vector2d way_m = left.p_world_m - right.p_world_m;
    const double length_m = way_m.norm();
    if (length_m > kNextOne * spacing_m) continue;
    near.for_each(i, [&](Index j) {
      if (j == left_[k] || !links_[static_cast<std::size_t>(j)]) return;
      const LinkElement& other = elements[static_cast<std::size_t>(j)];
      if (!other.faces_another_way(right)) return;
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

void ChainLinks::walk_from(const Elements& elements, Index first, bool closed) {
  const std::size_t begin = walked_in_order_.size();
  const std::pair<bool, Surfels::Index> rank(closed, elements[static_cast<std::size_t>(first)].index);
  for (Index i = first; i != kNone && !walked_[static_cast<std::size_t>(i)]; i = left_[static_cast<std::size_t>(i)]) {
    walked_[static_cast<std::size_t>(i)] = true;
    walked_in_order_.push_back(i);
  }
  const std::size_t count = walked_in_order_.size() - begin;
  if (!closed && count >= 4U * kWall) {  // the corner of two walls
    const auto last = static_cast<std::size_t>(walked_in_order_.back());
    closed = (elements[last].p_world_m - elements[static_cast<std::size_t>(first)].p_world_m).norm() < kAhead_m;
  }
  constexpr std::size_t kFewestOfClosed = 3;
  const double size_m = size_of(elements, walked_in_order_, begin, walked_in_order_.size());
  chains_.push_back({begin, walked_in_order_.size(), closed && count >= kFewestOfClosed, size_m, rank});
}

void ChainLinks::walk(const Elements& elements, const NearElements& near) {
  walked_in_order_.clear();
  chains_.clear();
  assign_with_room(walked_, links_.size(), 0);
  for (std::size_t k = 0; k < links_.size(); ++k) {
    if (links_[k] && right_[k] == kNone) walk_from(elements, static_cast<Index>(k), false);
  }
  for (std::size_t k = 0; k < links_.size(); ++k) {
    if (links_[k] && !walked_[k]) walk_from(elements, static_cast<Index>(k), true);
  }
  join_small(elements, near);
  ordered_.clear();
  before_joint_.clear();
  ordered_.reserve(walked_in_order_.capacity());
  before_joint_.reserve(walked_in_order_.capacity());
  for (const Index i : walked_in_order_) {
    ordered_.push_back(elements[static_cast<std::size_t>(i)].index);
    before_joint_.push_back(joint_[static_cast<std::size_t>(i)] != 0);
  }
}

std::size_t ChainLinks::group_of(std::size_t chain) const {
  while (group_[chain] != chain) chain = group_[chain];
  return chain;
}

/// A post or a cup is hit by few beams at a time, from different sides: there is no line to go on with. Elements of
/// small chains near each other are of one thing.
void ChainLinks::join_small(const Elements& elements, const NearElements& near) {
  constexpr auto kNotSmall = static_cast<std::size_t>(-1);
  assign_with_room(chain_of_, links_.size(), kNotSmall);
  assign_with_room(group_, chains_.size(), 0);
  for (std::size_t c = 0; c < chains_.size(); ++c) {
    group_[c] = c;
    const Run& run = chains_[c];
    if (run.end - run.first > kSmall || run.size_m > kSmallSize_m) continue;
    for (std::size_t k = run.first; k < run.end; ++k) chain_of_[static_cast<std::size_t>(walked_in_order_[k])] = c;
  }
  bool any = false;
  for (const Index i : walked_in_order_) {
    const std::size_t own = chain_of_[static_cast<std::size_t>(i)];
    if (own == kNotSmall) continue;
    const Eigen::Vector2d& p_world_m = elements[static_cast<std::size_t>(i)].p_world_m;
    near.for_each(i, [&](Index j) {
      const std::size_t chain = chain_of_[static_cast<std::size_t>(j)];
      if (chain == kNotSmall || chain == own) return;
      if ((elements[static_cast<std::size_t>(j)].p_world_m - p_world_m).norm() > kSameSmall_m) return;
      const std::size_t a = group_of(own), b = group_of(chain);
      group_[std::max(a, b)] = std::min(a, b);
      any |= a != b;
    });
  }
  if (!any) return;

  reordered_.clear();
  rejoined_.clear();
  reordered_.reserve(walked_in_order_.capacity());
  rejoined_.reserve(chains_.capacity());
  members_.clear();
  members_.reserve(chains_.capacity());
  for (std::size_t c = 0; c < chains_.size(); ++c) members_.emplace_back(group_of(c), c);
  std::sort(members_.begin(), members_.end());
  for (std::size_t m = 0; m < members_.size();) {
    const std::size_t group = members_[m].first, first = reordered_.size(), begin = m;
    for (; m < members_.size() && members_[m].first == group; ++m) {
      const Run& run = chains_[members_[m].second];
      for (std::size_t k = run.first; k < run.end; ++k) reordered_.push_back(walked_in_order_[k]);
    }
    const bool is_one = m - begin == 1;
    const double size_m = is_one ? chains_[group].size_m : size_of(elements, reordered_, first, reordered_.size());
    const bool closed = is_one ? chains_[group].closed : order_around(elements, first, size_m);
    rejoined_.push_back({first, reordered_.size(), closed, size_m, chains_[group].rank});
  }
  std::swap(walked_in_order_, reordered_);
  std::swap(chains_, rejoined_);
}

/// Orders the elements from `first` on as they are seen from outside, from right to left. Whether they close.
bool ChainLinks::order_around(const Elements& elements, std::size_t first, double size_m) {
  const double radius_m = std::max(0.5 * size_m, kLeastRadius_m);
  Eigen::Vector2d middle_m = Eigen::Vector2d::Zero();
  for (std::size_t k = first; k < reordered_.size(); ++k) {
    const LinkElement& element = elements[static_cast<std::size_t>(reordered_[k])];
    middle_m += element.p_world_m - radius_m * element.normal_world;
  }
  middle_m /= static_cast<double>(reordered_.size() - first);
  around_.clear();
  for (std::size_t k = first; k < reordered_.size(); ++k) {
    const Eigen::Vector2d d_m = elements[static_cast<std::size_t>(reordered_[k])].p_world_m - middle_m;
    around_.emplace_back(-std::atan2(d_m.y(), d_m.x()), reordered_[k]);
    joint_[static_cast<std::size_t>(reordered_[k])] = false;
  }
  std::sort(around_.begin(), around_.end());
  std::size_t begin = 0;
  double widest_rad = around_.front().first + 2.0 * kPi - around_.back().first;
  for (std::size_t k = 1; k < around_.size(); ++k) {
    const double gap_rad = around_[k].first - around_[k - 1].first;
    if (gap_rad > widest_rad) widest_rad = gap_rad, begin = k;
  }
  std::rotate(around_.begin(), around_.begin() + static_cast<std::ptrdiff_t>(begin), around_.end());
  for (std::size_t k = 0; k < around_.size(); ++k) reordered_[first + k] = around_[k].second;
  return around_.size() >= 3 && widest_rad < kOpenSmall_rad;
}

}  // namespace situation_awareness

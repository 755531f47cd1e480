// SPDX-License-Identifier: BSD-3-Clause
#include "situation_awareness/pipeline/obstacle_boundaries.hpp"

#include <algorithm>
#include <cmath>

#include "situation_awareness/geometry/angles.hpp"

namespace situation_awareness {
namespace {

/// Elements of a boundary, at least: fewer are no large obstacle.
constexpr std::size_t kFewestElements = 6;

/// m. Elements of a chain that are nearer to each other are fitted as one.
constexpr double kMostSpacing_m = 0.1;

/// Both ends of a boundary are one place if it has turned once around, up to this angle (rad), and they are no farther
/// apart than this (m): a lap that ends half a metre beside its begin has been around nevertheless.
constexpr double kOnceAround_rad = 0.8;
constexpr double kSeam_m = 1.0;
/// What a boundary has twice is cut off its end where that is so near to its begin (m).
constexpr double kTwice_m = 2.0;
/// A gap in a boundary is at least so long, and the ends of what is in it are so near to its own (m).
constexpr double kLeastGap_m = 0.3, kAtGap_m = 0.5;
/// One that was closed stays so while no more than this part of it has gone.
constexpr double kLost = 0.15;
/// Elements of a closed boundary, at least.
constexpr std::size_t kFewestOfClosed = 20;

double turn_between(const Eigen::Vector2d& a, const Eigen::Vector2d& b) {
  return std::atan2(a.x() * b.y() - a.y() * b.x(), a.dot(b));
}

/// Whether the elements, counter-clockwise, go once around an obstacle; what they have twice is then cut off their end.
bool go_around(std::vector<SplinegonElement>& elements, bool was_closed) {
  std::size_t count = elements.size();
  if (count < kFewestOfClosed) return false;
  double turn_rad = 0.0, length_m = 0.0;
  for (std::size_t i = 1; i < count; ++i) {
    turn_rad += turn_between(elements[i - 1].normal_world, elements[i].normal_world);
    length_m += (elements[i].p_world_m - elements[i - 1].p_world_m).norm();
  }
  const SplinegonElement& first = elements.front();
  const Eigen::Vector2d along(-first.normal_world.y(), first.normal_world.x());
  const auto ahead_m = [&] { return along.dot(elements[count - 1].p_world_m - first.p_world_m); };
  const auto apart_m = [&] { return (elements[count - 1].p_world_m - first.p_world_m).norm(); };
  while (count > kFewestOfClosed && ahead_m() > 0.0 && apart_m() < kTwice_m) {
    turn_rad -= turn_between(elements[count - 2].normal_world, elements[count - 1].normal_world);
    --count;
  }
  // A seam at a corner has its turn.
  if (was_closed || apart_m() < kAtGap_m) {
    turn_rad += turn_between(elements[count - 1].normal_world, first.normal_world);
  }
  if (was_closed) {
    if (apart_m() > std::max(kTwice_m, kLost * length_m)) return false;
  } else if (apart_m() > kSeam_m) {
    return false;
  }
  if (std::abs(turn_rad - 2.0 * kPi) > kOnceAround_rad) return false;
  elements.resize(count);
  return true;
}

bool is_chain_before(const ChainOfBoundary& a, const ChainOfBoundary& b) { return a.chain < b.chain; }

/// In a list by ascending chain; null if it is not there.
const ChainOfBoundary* find_chain(const std::vector<ChainOfBoundary>& list, std::uint64_t chain) {
  const auto found = std::lower_bound(list.begin(), list.end(), ChainOfBoundary{chain, 0}, is_chain_before);
  return found != list.end() && found->chain == chain ? &*found : nullptr;
}

}  // namespace

ObstacleBoundaries::ObstacleBoundaries(const SplinegonMapParams& boundaries, const SplinegonFitParams& fit,
                                       double spacing_m, double max_gap_m)
    : in_a_row_(static_cast<std::size_t>(std::max(1.0, std::floor(kMostSpacing_m / spacing_m)))),
      reach_m_(max_gap_m + spacing_m),
      map_(boundaries, fit) {}

void ObstacleBoundaries::move() {
  for (ObstacleBoundary& boundary : boundaries_) boundary.moved = true;
}

void ObstacleBoundaries::clear() {
  boundaries_.clear();
  chains_.clear();
  closed_.clear();
}

void ObstacleBoundaries::take(const PolygonMap& map, const Polygons& polygons, bool moved, const MotionOf& motion_of) {
  std::size_t count = 0;
  for (std::size_t c = 0; c < polygons.chains.size(); ++c) {
    const Chain& chain = polygons.chains[c];
    map.elements_of(c, elements_);
    if (elements_.size() < kFewestElements) continue;
    if (boundaries_.size() == count) boundaries_.emplace_back();
    ObstacleBoundary& boundary = boundaries_[count++];
    boundary.id = chain.id;
    boundary.closed = chain.closed;
    boundary.moved = moved;
    boundary.motion = motion_of(chain.first_seen_ns);
    boundary.first_seen_ns = chain.first_seen_ns;
    boundary.last_seen_ns = chain.last_seen_ns;
    take_elements(boundary.elements);
    boundary.closed = boundary.closed || go_around(boundary.elements, was_of_closed(boundary.id) != nullptr);
  }
  boundaries_.resize(count);
  closing_.clear();
  chains_.clear();
  put_.clear();
  for (ObstacleBoundary& boundary : boundaries_) {
    const std::size_t first = closing_.size();
    const std::uint64_t chain = boundary.id;
    put_into_gaps(boundary);
    if (!boundary.closed && lead_around(boundary)) put_into_gaps(boundary);  // also of what leads around
    if (boundary.closed) {
      closing_.push_back({boundary.id, boundary.id});
      name_closed(boundary, first);
    } else {
      closing_.resize(first);
    }
    chains_.push_back({chain, boundary.id});
  }
  follow_puts();
  std::sort(closing_.begin(), closing_.end(), is_chain_before);
  closed_.swap(closing_);
}

/// Of chains_, which have each the boundary that it would be. One may have been put into another one, and that into a
/// third one later.
void ObstacleBoundaries::follow_puts() {
  std::sort(chains_.begin(), chains_.end(), is_chain_before);
  for (ChainOfBoundary& of : chains_) {
    std::uint64_t chain = of.chain;
    for (auto put = put_.begin(); put != put_.end();) {
      if (put->chain == chain) {
        chain = put->boundary;
        put = put_.begin();
      } else {
        ++put;
      }
    }
    of.boundary = find_chain(chains_, chain)->boundary;
  }
}

/// Counter-clockwise: chains run clockwise around what they are the boundary of. Where they are finer than a fit needs,
/// some in a row are one.
void ObstacleBoundaries::take_elements(std::vector<SplinegonElement>& elements) const {
  elements.clear();
  for (std::size_t end = elements_.size(); end > 0;) {
    const std::size_t begin = end - std::min(end, in_a_row_);
    double weight = 0.0;
    Eigen::Vector2d p_world_m = Eigen::Vector2d::Zero(), along_world = Eigen::Vector2d::Zero();
    for (std::size_t i = begin; i < end; ++i) {
      const BoundaryElement& element = elements_[i];
      weight += 1.0 / element.variance_m2;
      p_world_m += element.p_world_m / element.variance_m2;
      along_world += element.along_world / element.variance_m2;
    }
    if (in_a_row_ == 1) {
      const BoundaryElement& element = elements_[begin];
      elements.push_back({element.p_world_m, {-element.along_world.y(), element.along_world.x()}, element.variance_m2});
    } else {
      along_world.normalize();
      elements.push_back({p_world_m / weight, {-along_world.y(), along_world.x()}, 1.0 / weight});
    }
    end = begin;
  }
}

const ChainOfBoundary* ObstacleBoundaries::was_of_closed(std::uint64_t chain) const {
  return find_chain(closed_, chain);
}

/// A closed boundary keeps its id, whichever of its chains is the longest now or has become one with another, unless a
/// chain of that id is elsewhere again. Its chains are those in closing_ from `first` on.
void ObstacleBoundaries::name_closed(ObstacleBoundary& boundary, std::size_t first) {
  for (std::size_t i = closing_.size(); i-- > first;) {  // its own chain first
    const ChainOfBoundary* const before = was_of_closed(closing_[i].chain);
    if (before == nullptr) continue;
    const bool is_elsewhere = std::any_of(boundaries_.begin(), boundaries_.end(), [&](const ObstacleBoundary& other) {
      return &other != &boundary && other.id == before->boundary && !other.elements.empty();
    });
    if (is_elsewhere) continue;
    boundary.id = before->boundary;
    break;
  }
  for (std::size_t i = first; i < closing_.size(); ++i) closing_[i].boundary = boundary.id;
}

/// Small things that lead from one end of a gap in a boundary to the other, one or several in a row, are a part of it:
/// a column in front of a wall, which was linked across its foot before it was seen well. Elements of what was put
/// somewhere are empty then.
void ObstacleBoundaries::put_into_gaps(ObstacleBoundary& boundary) {
  std::vector<SplinegonElement>& elements = boundary.elements;
  for (std::size_t i = elements.size(); i-- > 0;) {  // those before stay where they are
    if (i == 0 && !boundary.closed) return;
    const Eigen::Vector2d from_m = elements[i > 0 ? i - 1 : elements.size() - 1].p_world_m,
                          to_m = elements[i].p_world_m;
    if ((to_m - from_m).norm() < kLeastGap_m || !find_parts(boundary, from_m, to_m, kAtGap_m)) continue;
    joined_.clear();
    join_parts();
    elements.insert(elements.begin() + static_cast<std::ptrdiff_t>(i), joined_.begin(), joined_.end());
    give_parts(boundary);
  }
}

/// What leads from the end of an open boundary to its begin, and turns once around with it, closes it: walls that were
/// seen from too far away to know that they meet in a corner. They are as far apart as elements of one chain may be.
bool ObstacleBoundaries::lead_around(ObstacleBoundary& boundary) {
  if (boundary.elements.empty()) return false;
  const bool stays = was_of_closed(boundary.id) != nullptr;
  const double reach_m = stays ? kTwice_m : reach_m_;
  if (!find_parts(boundary, boundary.elements.back().p_world_m, boundary.elements.front().p_world_m, reach_m)) {
    return false;
  }
  joined_ = boundary.elements;
  join_parts();
  if (!go_around(joined_, true)) return false;
  boundary.elements.swap(joined_);
  boundary.closed = true;
  give_parts(boundary);
  return true;
}

/// Appends the elements of parts_ to joined_.
void ObstacleBoundaries::join_parts() {
  for (const ObstacleBoundary* const part : parts_) {
    joined_.insert(joined_.end(), part->elements.begin(), part->elements.end());
  }
}

/// Gives the boundary what else is known of parts_, whose elements were put into it, and leaves them empty.
void ObstacleBoundaries::give_parts(ObstacleBoundary& boundary) {
  for (ObstacleBoundary* const part : parts_) {
    boundary.first_seen_ns = std::min(boundary.first_seen_ns, part->first_seen_ns);
    boundary.last_seen_ns = std::max(boundary.last_seen_ns, part->last_seen_ns);
    closing_.push_back({part->id, boundary.id});
    put_.push_back({part->id, boundary.id});
    part->elements.clear();
  }
}

/// Whether others lead from one place to the other, each the nearest to what is before it: parts_, in order.
bool ObstacleBoundaries::find_parts(const ObstacleBoundary& boundary, Eigen::Vector2d from_m,
                                    const Eigen::Vector2d& to_m, double reach_m) {
  parts_.clear();
  do {
    ObstacleBoundary* next = nullptr;
    double least_m = reach_m;
    for (ObstacleBoundary& other : boundaries_) {
      if (&other == &boundary || other.closed || other.elements.empty() ||
          other.elements.size() >= boundary.elements.size() ||
          std::find(parts_.begin(), parts_.end(), &other) != parts_.end()) {
        continue;
      }
      const double apart_m = (other.elements.front().p_world_m - from_m).norm();
      if (apart_m < least_m) next = &other, least_m = apart_m;
    }
    if (next == nullptr) return false;
    parts_.push_back(next);
    from_m = next->elements.back().p_world_m;
  } while ((from_m - to_m).norm() > reach_m);
  return true;
}

}  // namespace situation_awareness

// SPDX-License-Identifier: BSD-3-Clause
#include "situation_awareness/map/polygons/polygon_map.hpp"

#include <algorithm>
#include <cmath>
#include <unordered_set>
#include <utility>

#include "situation_awareness/common/time.hpp"
#include "situation_awareness/common/usual_room.hpp"
#include "situation_awareness/geometry/angles.hpp"

namespace situation_awareness {
namespace {

/// Cosine between the normals of a hit and of the element it is on, at least.
constexpr double kFaces = 0.5;
/// The same of a hit without a normal: what is along its beam is seen.
constexpr double kVisible = 0.05;
/// Standard deviations of a hit's distance from the element it is on, at most.
constexpr double kGateSigmas = 4.0;
/// m^2. No element is known better: poses have errors that repeat.
constexpr double kLeastVariance_m2 = 1e-6;
/// m^2. Of the place of a new element on the straight way between two known ones.
constexpr double kBulgeVariance_m2 = 2.5e-5;
/// Part by which a hit turns the element's normal, at least.
constexpr double kTurnGain = 0.02;
/// Log-odds of existence: of the first hit, of each other hit, and at most.
constexpr double kFirstHit = 1.0;
constexpr double kHit = 0.5;
constexpr double kMostLogOdds = 6.0;
/// s. Longest time between scans for which passing beams count.
constexpr double kMaxStep_s = 0.25;
/// Beams without a return may be lost: they count by so much.
constexpr double kNoReturnWeight = 0.1;
/// m. Beams that end so far behind an element, at a hit near it, are weak evidence against it: what stood before a wall
/// and touched it is gone.
constexpr double kBehind_m = 0.025;
constexpr double kNearWeight = 0.2;
/// The same where they end beside it.
constexpr double kBesideWeight = 0.05;
constexpr double kBesideElement_m = 0.015;
/// Beams beside the nearest ones that are searched for a hit near an element.
constexpr std::ptrdiff_t kBeamsBeside = 4;
/// m. An element with a hit so near was not passed: the boundary may be a little elsewhere.
constexpr double kNearHit_m = 0.06;
/// m. Beams farther apart than this may pass beside a thing that stands between them.
constexpr double kCloseBeams_m = 0.05;
/// Sine of the angle between the beam and a link: below it the hits are of two things, one behind the other.
constexpr double kAlongBeam = 0.35;
/// m. Shorter links are of one thing all the same.
constexpr double kShortLink_m = 0.05;
/// Scans that are remembered to tell what was free, and the time between them.
constexpr std::size_t kWatches = 8;
constexpr double kWatchStep_s = 0.37;
/// Remembered scans that have to have seen a place free, and the age from which on a hit in one says that the thing
/// was there before.
constexpr int kWatchedBy = 3;
constexpr double kThereBefore_s = 1.0;
/// m. As kNearHit_m, in a remembered scan.
constexpr double kNearWatched_m = 0.12;
/// Elements nearer to each other along the boundary, as a part of their spacing, are one.
constexpr double kSamePlace = 0.4;
/// Links that are followed from one element to see whether another one is on its chain.
constexpr int kLinksFollowed = 6;
/// s. An element that was never confirmed is forgotten after so long without a hit.
constexpr double kForgotten_s = 10.0;
/// Chains that end so near to each other, in parts of the spacing, and with so small a step and turn between them, are
/// one.
constexpr double kSmallGap = 1.5;
constexpr double kSmallStep_m = 0.015;
constexpr double kSameDirection = 0.9;
/// Cosine between the normals of two chains that meet in a corner, at most.
constexpr double kCorner = 0.6;
/// A chain of so few elements, all of them so near to a larger one, is none of its own.
constexpr std::size_t kFewElements = 3;
constexpr double kOnChain_m = 0.035;

}  // namespace

PolygonMap::PolygonMap(const PolygonMapParams& params) : params_(params) {
  params_.validate();
  cell_m_ = std::max(params_.gate_m, params_.spacing_m) + 0.5 * params_.spacing_m;
  constexpr std::size_t kBuckets = 1U << 14U;
  buckets_.assign(kBuckets, kNone);
  watches_.resize(kWatches);
}

std::size_t PolygonMap::bucket(int cell_x, int cell_y) const {
  const auto hash = static_cast<std::uint32_t>(cell_x) * 73856093U ^ static_cast<std::uint32_t>(cell_y) * 19349663U;
  return hash & (buckets_.size() - 1U);
}

std::size_t PolygonMap::bucket_of(const Eigen::Vector2d& p_world_m) const {
  return bucket(static_cast<int>(std::floor(p_world_m.x() / cell_m_)),
                static_cast<int>(std::floor(p_world_m.y() / cell_m_)));
}

void PolygonMap::insert(Index index) {
  Surfel& surfel = surfels_[static_cast<std::size_t>(index)];
  Index& first = buckets_[bucket_of(surfel.p_world_m)];
  surfel.next = first;
  first = index;
}

void PolygonMap::erase(Index index) {
  Index* link = &buckets_[bucket_of(surfels_[static_cast<std::size_t>(index)].p_world_m)];
  while (*link != index) link = &surfels_[static_cast<std::size_t>(*link)].next;
  *link = surfels_[static_cast<std::size_t>(index)].next;
}

void PolygonMap::move(Index index, const Eigen::Vector2d& p_world_m) {
  Surfel& surfel = surfels_[static_cast<std::size_t>(index)];
  if (bucket_of(surfel.p_world_m) == bucket_of(p_world_m)) {
    surfel.p_world_m = p_world_m;
    return;
  }
  erase(index);
  surfel.p_world_m = p_world_m;
  insert(index);
}

template <class Act>
void PolygonMap::for_each_near(const Eigen::Vector2d& p_world_m, const Act& act) const {
  const int x = static_cast<int>(std::floor(p_world_m.x() / cell_m_));
  const int y = static_cast<int>(std::floor(p_world_m.y() / cell_m_));
  for (int dx = -1; dx <= 1; ++dx) {
    for (int dy = -1; dy <= 1; ++dy) {
      for (Index i = buckets_[bucket(x + dx, y + dy)]; i != kNone; i = surfels_[static_cast<std::size_t>(i)].next) {
        const Surfel& surfel = surfels_[static_cast<std::size_t>(i)];
        // Others share the bucket.
        if ((surfel.p_world_m - p_world_m).cwiseAbs().maxCoeff() > cell_m_) continue;
        act(i, surfel);
      }
    }
  }
}

bool PolygonMap::linked(Index right, Index left) const {
  return right != kNone && left != kNone && surfels_[static_cast<std::size_t>(right)].left == left &&
         surfels_[static_cast<std::size_t>(left)].right == right;
}

/// The element at the place of a hit, corrected by it; a new one where there is none.
PolygonMap::Index PolygonMap::fuse(const Eigen::Vector2d& p_world_m, const Eigen::Vector2d& normal_world,
                                   double variance_m2, bool has_normal) {
  const double least_cosine = has_normal ? kFaces : kVisible;
  Index best = kNone, double_of_it = kNone;
  double least = std::numeric_limits<double>::infinity();
  Index best_right = kNone;  // of the link on which the hit is
  double least_off_link = 1.0;
  Eigen::Vector2d on_link_m = Eigen::Vector2d::Zero();
  const double half_m = 0.5 * params_.spacing_m;
  for_each_near(p_world_m, [&](Index i, const Surfel& surfel) {
    if (surfel.normal_world.dot(normal_world) < (surfel.oriented ? least_cosine : kVisible)) return;
    const Eigen::Vector2d d_m = p_world_m - surfel.p_world_m;
    const double gate_m = std::min(params_.gate_m, kGateSigmas * std::sqrt(surfel.variance_m2 + variance_m2));
    const Eigen::Vector2d& normal = surfel.oriented ? surfel.normal_world : normal_world;
    const double across = normal.dot(d_m) / gate_m;
    if (std::abs(across) > 1.0) return;
    const double along_m = normal.x() * d_m.y() - normal.y() * d_m.x();
    const double score = across * across + along_m * along_m / (half_m * half_m);
    if (std::abs(along_m) <= half_m) {
      if (score < least) {
        least = score;
        double_of_it = best;
        best = i;
      } else {
        double_of_it = i;
      }
    }
    if (!linked(i, surfel.left)) return;
    const Surfel& left = surfels_[static_cast<std::size_t>(surfel.left)];
    const Eigen::Vector2d way_m = left.p_world_m - surfel.p_world_m;
    const double part = d_m.dot(way_m) / way_m.squaredNorm();
    if (!(part > 0.0 && part < 1.0)) return;
    const double off = (d_m - part * way_m).norm() / gate_m;
    const Eigen::Vector2d link_normal(-way_m.y(), way_m.x());
    if (off >= least_off_link || link_normal.dot(normal_world) < least_cosine * way_m.norm()) return;
    least_off_link = off;
    best_right = i;
    on_link_m = surfel.p_world_m + part * way_m;
  });

  if (best == kNone) {
    const Index created = create(p_world_m, normal_world, variance_m2);
    surfels_[static_cast<std::size_t>(created)].oriented = has_normal;
    if (best_right == kNone) {
      surfels_[static_cast<std::size_t>(created)].watched = was_watched(p_world_m);
      return created;
    }
    Surfel& right = surfels_[static_cast<std::size_t>(best_right)];
    const Index best_left = right.left;
    Surfel& left = surfels_[static_cast<std::size_t>(best_left)];
    Surfel& between = surfels_[static_cast<std::size_t>(created)];
    between.normal_world = (right.normal_world + left.normal_world).normalized();
    between.oriented = right.oriented || left.oriented;
    const double link_variance_m2 = std::max(right.variance_m2, left.variance_m2) + kBulgeVariance_m2;
    const double gain = link_variance_m2 / (link_variance_m2 + variance_m2);
    between.variance_m2 = gain * variance_m2;
    between.watched = right.watched && left.watched;
    between.confirmed = right.confirmed && left.confirmed;
    between.log_odds = std::max(kFirstHit, std::min(right.log_odds, left.log_odds));
    between.chain = right.chain == left.chain ? right.chain : 0;
    between.right = best_right;
    between.left = best_left;
    right.left = left.right = created;
    // Across the link only: along it the hit is where it is.
    move(created, on_link_m + gain * (p_world_m - on_link_m));
    return created;
  }

  Surfel& surfel = surfels_[static_cast<std::size_t>(best)];
  if (!surfel.oriented && has_normal) {
    surfel.oriented = true;
    surfel.normal_world = normal_world;
  }
  const Eigen::Vector2d d_m = p_world_m - surfel.p_world_m;
  const double gain = surfel.variance_m2 / (surfel.variance_m2 + variance_m2);
  const double along_m = along(surfel).dot(d_m);
  surfel.low_m = std::min(surfel.low_m, along_m);
  surfel.high_m = std::max(surfel.high_m, along_m);
  surfel.variance_m2 = std::max((1.0 - gain) * surfel.variance_m2, kLeastVariance_m2);
  const Eigen::Vector2d moved_m = surfel.p_world_m + gain * surfel.normal_world.dot(d_m) * surfel.normal_world;
  const double turn = std::max(kTurnGain, 1.0 / (surfel.hits + 1.0));
  if (has_normal)
    surfel.normal_world = (surfel.normal_world + turn * (normal_world - surfel.normal_world)).normalized();
  ++surfel.hits;
  if (surfel.last_seen_ns != stamp_ns_) {
    surfel.log_odds = std::min(surfel.log_odds + kHit, kMostLogOdds);
    surfel.seen_s += step_s_;
    surfel.last_seen_ns = stamp_ns_;
  }
  move(best, moved_m);
  if (double_of_it != kNone) merge_double(best, double_of_it);
  return best_right == kNone ? best : take_into_chain(best, best_right);
}

/// An element on the link of two others that is not of their chain becomes of it, or one of them. Returns what it has
/// become.
PolygonMap::Index PolygonMap::take_into_chain(Index index, Index right) {
  const Index left = surfels_[static_cast<std::size_t>(right)].left;
  if (index == right || index == left || !linked(right, left)) return index;
  Surfel& surfel = surfels_[static_cast<std::size_t>(index)];
  const Eigen::Vector2d from_m = surfels_[static_cast<std::size_t>(right)].p_world_m;
  const Eigen::Vector2d way_m = surfels_[static_cast<std::size_t>(left)].p_world_m - from_m;
  const double length_m = way_m.norm();
  const double along_m = way_m.dot(surfel.p_world_m - from_m) / length_m;
  if (!(along_m > 0.0 && along_m < length_m)) return index;
  const double least_m = kSamePlace * params_.spacing_m;
  if (along_m < least_m || length_m - along_m < least_m) {
    const Index kept = along_m < least_m ? right : left;
    merge_double(kept, index);
    return surfel.alive ? index : kept;
  }
  unlink(index);
  surfels_[static_cast<std::size_t>(right)].left = surfels_[static_cast<std::size_t>(left)].right = index;
  surfel.right = right;
  surfel.left = left;
  return index;
}

/// Two elements at one place of the same boundary: errors of poses made two of one.
void PolygonMap::merge_double(Index kept, Index other) {
  Surfel& surfel = surfels_[static_cast<std::size_t>(kept)];
  const Surfel& lost = surfels_[static_cast<std::size_t>(other)];
  const Eigen::Vector2d d_m = lost.p_world_m - surfel.p_world_m;
  if (std::abs(along(surfel).dot(d_m)) > kSamePlace * params_.spacing_m) return;
  const double part = surfel.variance_m2 / (surfel.variance_m2 + lost.variance_m2);
  surfel.first_seen_ns = std::min(surfel.first_seen_ns, lost.first_seen_ns);
  surfel.hits += lost.hits;
  surfel.seen_s = std::max(surfel.seen_s, lost.seen_s);
  surfel.confirmed |= lost.confirmed;
  surfel.watched &= lost.watched;
  surfel.log_odds = std::max(surfel.log_odds, lost.log_odds);
  if (surfel.chain == 0) surfel.chain = lost.chain;
  const Eigen::Vector2d moved_m = surfel.p_world_m + part * surfel.normal_world.dot(d_m) * surfel.normal_world;
  remove(other);
  move(kept, moved_m);
}

/// Takes it out of its chain, which goes on without it.
void PolygonMap::unlink(Index index) {
  Surfel& surfel = surfels_[static_cast<std::size_t>(index)];
  const bool has_right = linked(surfel.right, index);
  const bool has_left = linked(index, surfel.left);
  if (has_right && surfel.right == surfel.left) {  // a circle of two
    Surfel& other = surfels_[static_cast<std::size_t>(surfel.right)];
    other.right = other.left = surfel.right = surfel.left = kNone;
    return;
  }
  if (has_right) surfels_[static_cast<std::size_t>(surfel.right)].left = has_left ? surfel.left : kNone;
  if (has_left) surfels_[static_cast<std::size_t>(surfel.left)].right = has_right ? surfel.right : kNone;
  surfel.right = surfel.left = kNone;
}

void PolygonMap::remove(Index index) {
  erase(index);
  unlink(index);
  surfels_[static_cast<std::size_t>(index)].alive = false;
  free_.push_back(index);
}

PolygonMap::Index PolygonMap::create(const Eigen::Vector2d& p_world_m, const Eigen::Vector2d& normal_world,
                                     double variance_m2) {
  Index index = kNone;
  if (free_.empty()) {
    index = static_cast<Index>(surfels_.size());
    surfels_.emplace_back();
  } else {
    index = free_.back();
    free_.pop_back();
  }
  Surfel& surfel = surfels_[static_cast<std::size_t>(index)];
  surfel = Surfel{};
  surfel.p_world_m = p_world_m;
  surfel.normal_world = normal_world;
  surfel.variance_m2 = variance_m2;
  surfel.log_odds = kFirstHit;
  surfel.first_seen_ns = surfel.last_seen_ns = stamp_ns_;
  surfel.hits = 1;
  surfel.alive = true;
  insert(index);
  return index;
}

/// A scan saw the boundary go on from one element to the other: they and those between them are linked in order.
void PolygonMap::link(Index right, Index left) {
  Index on_chain = right;
  for (int k = 0; k < kLinksFollowed; ++k) {
    const Index next = surfels_[static_cast<std::size_t>(on_chain)].left;
    if (!linked(on_chain, next)) break;
    if (next == left) return;
    on_chain = next;
  }
  const Eigen::Vector2d from_m = surfels_[static_cast<std::size_t>(right)].p_world_m;
  const Eigen::Vector2d way_m = surfels_[static_cast<std::size_t>(left)].p_world_m - from_m;
  const double length_m = way_m.norm();
  if (length_m < 1e-6 || length_m > params_.max_gap_m + params_.gate_m) return;
  const Eigen::Vector2d normal(-way_m.y() / length_m, way_m.x() / length_m);  // towards the free side
  // Noise may turn the order of elements that are near to each other.
  if (normal.dot(surfels_[static_cast<std::size_t>(right)].normal_world) < 0.0 ||
      normal.dot(surfels_[static_cast<std::size_t>(left)].normal_world) < 0.0) {
    return;
  }
  between_.clear();
  between_.emplace_back(0.0, right);
  for_each_near(from_m + 0.5 * way_m, [&](Index i, const Surfel& surfel) {
    if (i == right || i == left || surfel.normal_world.dot(normal) < kFaces) return;
    const Eigen::Vector2d d_m = surfel.p_world_m - from_m;
    const double part = d_m.dot(way_m) / (length_m * length_m);
    if (!(part > 0.0 && part < 1.0) || std::abs(normal.dot(d_m)) > 0.5 * params_.spacing_m) return;
    between_.emplace_back(part, i);
  });
  between_.emplace_back(1.0, left);
  std::sort(between_.begin(), between_.end());
  for (std::size_t k = 0; k + 1 < between_.size(); ++k) link_neighbours(between_[k].second, between_[k + 1].second);
}

/// Unless one of them has a nearer neighbour.
void PolygonMap::link_neighbours(Index right, Index left) {
  if (right == left || linked(right, left) || linked(left, right)) return;
  Surfel& a = surfels_[static_cast<std::size_t>(right)];
  Surfel& b = surfels_[static_cast<std::size_t>(left)];
  const double distance_m = (a.p_world_m - b.p_world_m).norm();
  const auto nearer = [&](const Surfel& from, Index current, bool agreed) {
    return current == kNone || !agreed ||
           distance_m < (surfels_[static_cast<std::size_t>(current)].p_world_m - from.p_world_m).norm();
  };
  const bool a_has_left = linked(right, a.left);
  const bool b_has_right = linked(b.right, left);
  if (!nearer(a, a.left, a_has_left) || !nearer(b, b.right, b_has_right)) return;
  // What is not confirmed breaks no chain of what is.
  const auto is_confirmed = [&](Index index) { return surfels_[static_cast<std::size_t>(index)].confirmed; };
  if (!b.confirmed && a_has_left && a.confirmed && is_confirmed(a.left)) return;
  if (!a.confirmed && b_has_right && b.confirmed && is_confirmed(b.right)) return;
  const Index beyond_left = a_has_left ? a.left : kNone;
  const Index beyond_right = b_has_right ? b.right : kNone;
  a.left = left;
  b.right = right;
  // What is put between two neighbours is a neighbour of both.
  const Eigen::Vector2d way_m = b.p_world_m - a.p_world_m;
  if (beyond_left != kNone && !linked(left, b.left)) {
    Surfel& c = surfels_[static_cast<std::size_t>(beyond_left)];
    if (way_m.dot(c.p_world_m - b.p_world_m) > 0.0) b.left = beyond_left, c.right = left;
  }
  if (beyond_right != kNone && !linked(a.right, right)) {
    Surfel& c = surfels_[static_cast<std::size_t>(beyond_right)];
    if (way_m.dot(a.p_world_m - c.p_world_m) > 0.0) a.right = beyond_right, c.left = right;
  }
}

/// Elements that end a chain go on with the next one that begins a chain, ahead or around a corner, if it is so near
/// that nothing is between them.
void PolygonMap::close_gaps() {
  for (std::size_t k = 0; k < surfels_.size(); ++k) {
    Surfel& surfel = surfels_[k];
    const auto right = static_cast<Index>(k);
    if (!surfel.alive || !surfel.oriented) continue;
    if (linked(right, surfel.left)) {
      if (surfels_[static_cast<std::size_t>(surfel.left)].confirmed || !surfel.confirmed) continue;
      // The end of a chain may lead to what is not confirmed; if not in its direction, that is noise.
      Surfel& left = surfels_[static_cast<std::size_t>(surfel.left)];
      const Eigen::Vector2d way_m = left.p_world_m - surfel.p_world_m;
      const Eigen::Vector2d normal(-way_m.y(), way_m.x());
      if (normal.dot(surfel.normal_world) > 0.0 && normal.dot(left.normal_world) > 0.0) continue;
      surfel.left = left.right = kNone;
    }
    Index best = kNone;
    double least_m = kSmallGap * params_.spacing_m;
    for_each_near(surfel.p_world_m, [&](Index i, const Surfel& other) {
      if (i == right || !other.oriented || linked(other.right, i) || linked(i, right)) return;
      const Eigen::Vector2d d_m = other.p_world_m - surfel.p_world_m;
      const double gap_m = d_m.norm();
      if (gap_m >= least_m) return;
      const Eigen::Vector2d normal(-d_m.y(), d_m.x());
      const bool goes_on = along(surfel).dot(d_m) > 0.0 && std::abs(surfel.normal_world.dot(d_m)) < kSmallStep_m &&
                           surfel.normal_world.dot(other.normal_world) > kSameDirection;
      const bool is_corner = surfel.confirmed && other.confirmed &&
                             surfel.normal_world.dot(other.normal_world) < kCorner &&
                             normal.dot(surfel.normal_world) > 0.0 && normal.dot(other.normal_world) > 0.0;
      if (!goes_on && !is_corner) return;
      least_m = gap_m;
      best = i;
    });
    if (best == kNone) continue;
    surfel.left = best;
    surfels_[static_cast<std::size_t>(best)].right = right;
  }
}

PolygonMap::View PolygonMap::view_of(const Watch& watch, const Eigen::Vector2d& p_level_m, double near_m,
                                     double* weight) const {
  const std::vector<float>& azimuth_rad = watch.free_space.azimuth_rad;
  const std::vector<float>& range_m = watch.free_space.range_m;
  if (azimuth_rad.size() < 2) return View::kUnknown;
  const double range = p_level_m.norm();
  double azimuth = std::atan2(p_level_m.y(), p_level_m.x());
  while (azimuth < azimuth_rad.front()) azimuth += 2.0 * kPi;
  while (azimuth >= azimuth_rad.front() + 2.0 * kPi) azimuth -= 2.0 * kPi;
  const auto above = std::upper_bound(azimuth_rad.begin(), azimuth_rad.end(), static_cast<float>(azimuth));
  if (above == azimuth_rad.begin() || above == azimuth_rad.end()) return View::kUnknown;
  const std::ptrdiff_t left = above - azimuth_rad.begin();
  const std::ptrdiff_t right = left - 1;
  const auto at = [&](std::ptrdiff_t i) { return static_cast<double>(range_m[static_cast<std::size_t>(i)]); };
  const auto angle = [&](std::ptrdiff_t i) { return static_cast<double>(azimuth_rad[static_cast<std::size_t>(i)]); };

  const auto beams = static_cast<std::ptrdiff_t>(range_m.size());
  for (std::ptrdiff_t i = std::max<std::ptrdiff_t>(right - kBeamsBeside, 0);
       i <= std::min(left + kBeamsBeside, beams - 1); ++i) {
    if (at(i) <= 0.0 || std::abs(at(i) - range) > near_m) continue;
    const double dx = at(i) * std::cos(angle(i)) - p_level_m.x();
    const double dy = at(i) * std::sin(angle(i)) - p_level_m.y();
    if (dx * dx + dy * dy >= near_m * near_m) continue;
    const double nearest_m = std::min(at(right), at(left)) - range;
    *weight = nearest_m > kBehind_m ? kNearWeight : nearest_m > -kBesideElement_m ? kBesideWeight : 0.0;
    return View::kHit;
  }
  const double margin_m = range + params_.pass_margin_m;
  if (!(at(right) > margin_m && at(left) > margin_m)) return View::kUnknown;
  const double apart_m = range * (angle(left) - angle(right));
  *weight = std::min(1.0, std::pow(kCloseBeams_m / apart_m, 2));
  if (std::max(at(right), at(left)) >= watch.most_m) *weight *= kNoReturnWeight;
  return View::kPassed;
}

/// Whether something came to this place while it was seen to be free.
bool PolygonMap::was_watched(const Eigen::Vector2d& p_world_m) const {
  int passed = 0;
  for (const Watch& watch : watches_) {
    if (watch.free_space.range_m.empty()) continue;
    double weight = 0.0;
    const View view = view_of(watch, watch.T_level_world * p_world_m, kNearWatched_m, &weight);
    if (view == View::kHit && seconds_between(watch.stamp_ns, stamp_ns_) > kThereBefore_s) return false;
    if (view == View::kPassed && weight > kNoReturnWeight) ++passed;
  }
  return passed >= kWatchedBy;
}

void PolygonMap::set_now(const Polylines& polylines) {
  now_.stamp_ns = stamp_ns_;
  now_.T_level_world = inverse(polylines.T_world_level);
  now_.free_space = polylines.free_space;
  now_.most_m = 0.0;
  for (const float range_m : now_.free_space.range_m) now_.most_m = std::max(now_.most_m, static_cast<double>(range_m));
}

void PolygonMap::remember() {
  const Watch& last = watches_[(next_watch_ + kWatches - 1) % kWatches];
  if (!last.free_space.range_m.empty() && seconds_between(last.stamp_ns, stamp_ns_) < kWatchStep_s) return;
  watches_[next_watch_] = now_;
  next_watch_ = (next_watch_ + 1) % kWatches;
}

/// Elements whose place beams have passed lose existence, hidden ones never.
void PolygonMap::see_through(PolygonMapUpdate& update) {
  const Eigen::Matrix2d R_level_world = now_.T_level_world.rotation();
  const double rate = std::min(step_s_, kMaxStep_s) * kMostLogOdds / params_.removal_s;
  for (std::size_t k = 0; k < surfels_.size(); ++k) {
    Surfel& surfel = surfels_[k];
    if (!surfel.alive || surfel.last_seen_ns == stamp_ns_) continue;
    const char* reason = "";
    const Eigen::Vector2d p_level_m = R_level_world * surfel.p_world_m + now_.T_level_world.translation_m;
    double weight = 0.0;
    if (p_level_m.squaredNorm() < now_.most_m * now_.most_m) {
      const View view = view_of(now_, p_level_m, kNearHit_m, &weight);
      const bool faces = (R_level_world * surfel.normal_world).dot(p_level_m) < -kFaces * p_level_m.norm();
      if (view == View::kUnknown) weight = 0.0;
      if (view == View::kHit && !faces) weight = std::min(weight, kBesideWeight);
      surfel.log_odds -= weight * rate;
      if (surfel.log_odds < 0.0) reason = "passed by beams";
    }
    if (!surfel.confirmed && seconds_between(surfel.last_seen_ns, stamp_ns_) > kForgotten_s) reason = "not seen again";
    if (*reason == '\0') continue;
    remove(static_cast<Index>(k));
    ++update.removed;
    ++update.reasons[reason];
  }
}

PolygonMapUpdate PolygonMap::update(const Polylines& polylines, const Eigen::Matrix3d& pose_covariance,
                                    PolygonMapUpdate memory) {
  PolygonMapUpdate report = std::move(memory);
  report.fused = report.created = report.removed = 0;
  report.reasons.reset();
  if (stamp_ns_ != std::numeric_limits<std::int64_t>::min() && polylines.stamp_ns <= stamp_ns_) {
    ++report.reasons["stamp not after the one before"];
    return report;
  }
  step_s_ =
      stamp_ns_ == std::numeric_limits<std::int64_t>::min() ? 0.0 : seconds_between(stamp_ns_, polylines.stamp_ns);
  stamp_ns_ = polylines.stamp_ns;
  if (step_s_ > params_.absence_s) {
    for (Watch& watch : watches_) watch.free_space.range_m.clear();
    step_s_ = 0.0;
  }
  const double pose_variance_m2 = std::max(pose_covariance(0, 0), pose_covariance(1, 1));
  if (pose_variance_m2 > params_.max_pose_sigma_m * params_.max_pose_sigma_m) {
    ++report.reasons["pose not known well enough"];
    return report;
  }

  const Pose2& T_world_level = polylines.T_world_level;
  const Eigen::Matrix2d R_world_level = T_world_level.rotation();
  assign_with_room(of_hit_, polylines.hits.size(), kNone);
  const std::size_t before = elements();
  for (std::size_t i = 0; i < polylines.hits.size(); ++i) {
    const PolylineHit& hit = polylines.hits[i];
    const Eigen::Vector2d normal_world = R_world_level * hit.normal_level;
    const Eigen::Vector2d offset_m = R_world_level * hit.p_level_m;
    Eigen::Vector3d by_pose;
    by_pose << normal_world, normal_world.dot(Eigen::Vector2d(-offset_m.y(), offset_m.x()));
    const double variance_m2 = hit.sigma_m * hit.sigma_m + by_pose.dot(pose_covariance * by_pose);
    of_hit_[i] = fuse(offset_m + T_world_level.translation_m, normal_world, variance_m2, hit.has_normal);
  }
  report.created = static_cast<int>(elements() - before);
  report.fused = static_cast<int>(polylines.hits.size()) - report.created;

  for (const Polyline& polyline : polylines.polylines) {
    for (std::size_t i = polyline.first_hit; i + 1 < polyline.first_hit + polyline.hits; ++i) {
      const Index right = of_hit_[i];
      const Index left = of_hit_[i + 1];
      if (right == left || !surfels_[static_cast<std::size_t>(right)].alive ||
          !surfels_[static_cast<std::size_t>(left)].alive) {
        continue;
      }
      const Eigen::Vector2d& p_m = polylines.hits[i].p_level_m;
      const Eigen::Vector2d way_m = polylines.hits[i + 1].p_level_m - p_m;
      const double length_m = way_m.norm();
      if (length_m > params_.max_gap_m) continue;
      const double sine = std::abs(way_m.x() * p_m.y() - way_m.y() * p_m.x()) / (length_m * p_m.norm());
      if (length_m > kShortLink_m && sine < kAlongBeam) continue;
      link(right, left);
    }
  }
  set_now(polylines);
  see_through(report);
  close_gaps();
  for (const Index index : of_hit_) {
    Surfel& surfel = surfels_[static_cast<std::size_t>(index)];
    if (!surfel.alive || surfel.confirmed) continue;
    const double age_s = surfel.watched ? surfel.seen_s : seconds_between(surfel.first_seen_ns, stamp_ns_);
    surfel.confirmed =
        surfel.hits >= params_.confirm_hits && age_s >= (surfel.watched ? params_.park_s : params_.confirm_s);
  }
  remember();
  return report;
}

/// Appends the confirmed elements of the chain to walk_, from its right end to its left.
void PolygonMap::walk_chain(Index from) {
  Index first = from;
  bool closed = false;
  for (;;) {
    const Index right = surfels_[static_cast<std::size_t>(first)].right;
    if (!linked(right, first)) break;
    first = right;
    if (first == from) {
      closed = true;
      break;
    }
  }
  std::size_t begin = walk_.size();
  const auto end_chain = [&] {
    if (walk_.size() == begin) return;
    chains_.emplace_back(begin, walk_.size());
    closed_.push_back(false);
    begin = walk_.size();
  };
  const std::size_t chains_before = chains_.size();
  for (Index i = first;;) {
    Surfel& surfel = surfels_[static_cast<std::size_t>(i)];
    surfel.walked = true;
    if (surfel.confirmed) {
      if (walk_.size() > begin &&
          (surfel.p_world_m - surfels_[static_cast<std::size_t>(walk_.back())].p_world_m).norm() > params_.max_gap_m) {
        end_chain();
      }
      walk_.push_back(i);
    }
    const Index left = surfel.left;
    if (!linked(i, left) || left == first) break;
    i = left;
  }
  end_chain();
  if (closed && chains_.size() == chains_before + 1) {
    const auto& [low, high] = chains_.back();
    closed_.back() = high - low > 3 && (surfels_[static_cast<std::size_t>(walk_[low])].p_world_m -
                                        surfels_[static_cast<std::size_t>(walk_[high - 1])].p_world_m)
                                               .norm() <= params_.max_gap_m;
  }
}

/// An id goes to the chain with most of its elements; what is left of a chain gets a new one.
void PolygonMap::name_chains() {
  thread_local std::vector<std::pair<std::uint64_t, std::size_t>> claims;  // of an id by a chain; kept for its memory
  claims.clear();
  for (std::size_t c = 0; c < chains_.size(); ++c) {
    for (std::size_t k = chains_[c].first; k < chains_[c].second; ++k) {
      const std::uint64_t id = surfels_[static_cast<std::size_t>(walk_[k])].chain;
      if (id != 0) claims.emplace_back(id, c);
    }
  }
  std::sort(claims.begin(), claims.end());
  // Runs of equal claims are counted; the largest first.
  struct Claim {
    std::size_t elements;
    std::uint64_t id;
    std::size_t chain;
  };
  thread_local std::vector<Claim> sorted;  // kept for its memory
  sorted.clear();
  for (std::size_t i = 0; i < claims.size();) {
    std::size_t j = i;
    while (j < claims.size() && claims[j] == claims[i]) ++j;
    sorted.push_back({j - i, claims[i].first, claims[i].second});
    i = j;
  }
  std::sort(sorted.begin(), sorted.end(), [](const Claim& a, const Claim& b) {
    if (a.elements != b.elements) return a.elements > b.elements;
    return a.id != b.id ? a.id < b.id : a.chain < b.chain;
  });
  thread_local std::vector<std::uint64_t> of_chain;
  thread_local std::unordered_set<std::uint64_t> taken;
  assign_with_room(of_chain, chains_.size(), 0);
  taken.clear();
  for (const Claim& claim : sorted) {
    if (of_chain[claim.chain] != 0 || !taken.insert(claim.id).second) continue;
    of_chain[claim.chain] = claim.id;
  }
  for (std::size_t c = 0; c < chains_.size(); ++c) {
    if (of_chain[c] == 0) of_chain[c] = next_id_++;
    for (std::size_t k = chains_[c].first; k < chains_[c].second; ++k) {
      Surfel& surfel = surfels_[static_cast<std::size_t>(walk_[k])];
      surfel.chain = of_chain[c];
      surfel.elements_of_chain = chains_[c].second - chains_[c].first;
    }
  }
}

/// Whether a chain of few elements lies on a larger one: what is left of a thing that touched a wall.
bool PolygonMap::is_beside_larger(std::size_t chain) const {
  const auto& [first, end] = chains_[chain];
  if (end - first > kFewElements) return false;
  for (std::size_t k = first; k < end; ++k) {
    const Surfel& surfel = surfels_[static_cast<std::size_t>(walk_[k])];
    bool beside = false;
    for_each_near(surfel.p_world_m, [&](Index /*index*/, const Surfel& other) {
      beside |= other.elements_of_chain > kFewElements && (other.p_world_m - surfel.p_world_m).norm() < kOnChain_m;
    });
    if (!beside) return false;
  }
  return true;
}

Polygons PolygonMap::polygons(Polygons memory) {
  Polygons result = std::move(memory);
  result.stamp_ns = stamp_ns_;
  walk_.clear();
  chains_.clear();
  closed_.clear();
  for (Surfel& surfel : surfels_) surfel.walked = false, surfel.elements_of_chain = 0;
  for (std::size_t i = 0; i < surfels_.size(); ++i) {
    if (surfels_[i].alive && !surfels_[i].walked) walk_chain(static_cast<Index>(i));
  }
  name_chains();
  std::size_t used = 0;
  for (std::size_t c = 0; c < chains_.size(); ++c) {
    if (is_beside_larger(c)) continue;
    if (result.chains.size() == used) result.chains.emplace_back();
    make_chain(c, result.chains[used++]);
  }
  result.chains.resize(used);
  return result;
}

void PolygonMap::make_chain(std::size_t chain, Chain& result) {
  elements_.clear();
  double least_log_odds = kMostLogOdds;
  result.first_seen_ns = std::numeric_limits<std::int64_t>::max();
  result.last_seen_ns = std::numeric_limits<std::int64_t>::min();
  for (std::size_t k = chains_[chain].first; k < chains_[chain].second; ++k) {
    const Surfel& surfel = surfels_[static_cast<std::size_t>(walk_[k])];
    elements_.push_back({surfel.p_world_m, along(surfel), surfel.variance_m2, surfel.low_m, surfel.high_m});
    result.id = surfel.chain;
    result.first_seen_ns = std::min(result.first_seen_ns, surfel.first_seen_ns);
    result.last_seen_ns = std::max(result.last_seen_ns, surfel.last_seen_ns);
    least_log_odds = std::min(least_log_odds, surfel.log_odds);
  }
  result.closed = closed_[chain];
  result.p_exists = 1.0 / (1.0 + std::exp(-least_log_odds));
  chain_fit_.fit(elements_, result.closed, params_.tolerance_m, result.vertices);
}

}  // namespace situation_awareness

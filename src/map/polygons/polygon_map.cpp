// SPDX-License-Identifier: BSD-3-Clause
#include "situation_awareness/map/polygons/polygon_map.hpp"

#include <algorithm>
#include <cmath>
#include <utility>

#include "situation_awareness/common/count.hpp"
#include "situation_awareness/common/time.hpp"
#include "situation_awareness/common/usual_room.hpp"
#include "situation_awareness/geometry/angles.hpp"
#include "surfels_along.hpp"

namespace situation_awareness {
namespace {

// Where no source is named, none is recorded; the sensitivity of these was not measured.

/// s. After a longer gap between scans nothing is known of what was watched, and no more time counts for what was hit
/// before and after it.
constexpr double kAbsence_s = 2.0;

/// Cosine between the normals of a hit and of the element it is on, at least.
constexpr double kFaces = 0.5;
/// The same of a hit without a normal: what is along its beam is seen.
constexpr double kVisible = 0.05;
/// Standard deviations of a hit's distance from the element it is on, at most.
constexpr double kGateSigmas = 4.0;
/// A hit without a normal goes to an element that is well known rather than to one of few hits.
constexpr double kFewHitsPenalty = 2.0;
/// m^2. No element is known better: poses have errors that repeat.
constexpr double kLeastVariance_m2 = 1e-6;
/// m^2. Of the place of a new element on the straight way between two known ones.
constexpr double kBulgeVariance_m2 = 2.5e-5;
/// Distance of those two along the boundary, in parts of the spacing, at most.
constexpr double kBetween = 2.5;
/// Cosine between their normals, at least.
constexpr double kOneSurface = 0.9;
/// The same of two that are on a line, and their distance, in parts of the spacing, up to which they stand for all of
/// it.
constexpr double kStraight = 0.97;
constexpr double kFilled = 1.3;
/// Part by which a hit turns the element's normal, at least.
constexpr double kTurnGain = 0.02;
/// The extent of an element leaves out a tenth of its hits on either side: those that noise put there. In m, by how
/// much it changes with a hit, at least.
constexpr double kInside = 0.9;
constexpr double kExtentStep_m = 0.001;
/// s. Looks at a place tell the more the longer they are apart, and are independent after so long. So what is seen in a
/// second tells the same whether a scanner looks 4 or 40 times, and a scan after a pause tells no more than one look.
constexpr double kLook_s = 0.25;
/// Log-odds of existence: of the first hit, and of a hit in each other independent look. A look that passes takes about
/// as much with the default of removal_s: what is hit in less than about half of the looks at it goes.
constexpr double kFirstHit = 1.0;
constexpr double kHitLook = 1.5;
/// m^2. Of a hit across its edge, at least and at most: both can be squared, and the map that is saved be loaded.
constexpr double kLeastHit_m2 = 1e-11, kMostHit_m2 = 1e8;
/// Scans that are remembered to tell what was free, and the time between them.
constexpr std::size_t kWatches = 8;
constexpr double kWatchStep_s = 0.37;
/// Remembered scans that have to have seen a place free, and the age from which on a hit in one says that the thing
/// was there before.
constexpr int kWatchedBy = 3;
constexpr double kThereBefore_s = 1.0;
/// m. What a scan has a hit so near of has not left.
constexpr double kLeft_m = 0.05;
/// m. A remembered scan hit what it has a hit so near of.
constexpr double kNearWatched_m = 0.12;
/// Elements nearer to each other along the boundary, as a part of their spacing, are one.
constexpr double kSamePlace = 0.4;
/// From one element to another one, along the boundary.
double between_m(const Surfel& from, const Surfel& to) { return from.along_world().dot(to.p_world_m - from.p_world_m); }

std::int64_t drawn_ns(const Surfel& surfel) { return surfel.first_seen_ns + nanoseconds(0.5 * surfel.seen_s); }

/// The known element that stands for the place of a later one as well: by a hit that strayed beyond the gate of all
/// known ones it was begun, and by others it was drawn to their boundary. None, if it is one of its own.
Surfels::Index known_at(const Surfels& surfels, Surfels::Index later, const PolygonMapParams& params) {
  const Surfel& own = surfels[later];
  Surfels::Index right = Surfels::kNone, left = Surfels::kNone;
  double right_m = kFilled * params.spacing_m, left_m = right_m;
  surfels.for_each_near(own.p_world_m, left_m, [&](Surfels::Index i, const Surfel& surfel) {
    const bool was_known = surfel.confirmed && seconds_between(surfel.first_seen_ns, own.first_seen_ns) > kLook_s;
    if (i == later || !was_known || surfel.normal_world.dot(own.normal_world) < kOneSurface) return;
    const double across_m = surfel.normal_world.dot(own.p_world_m - surfel.p_world_m);
    if (std::abs(across_m) > kGateSigmas * std::sqrt(surfel.variance_m2 + own.variance_m2)) return;
    const double along_m = between_m(surfel, own);
    if (along_m >= 0.0 && along_m < right_m) right = i, right_m = along_m;
    if (along_m < 0.0 && -along_m < left_m) left = i, left_m = -along_m;
  });
  if (right == Surfels::kNone || left == Surfels::kNone) return Surfels::kNone;
  if (right_m + left_m > kFilled * params.spacing_m) return Surfels::kNone;
  return right_m < left_m ? right : left;
}

}  // namespace

PolygonMap::PolygonMap(const PolygonMapParams& params)
    : params_(params),
      surfels_((params.validate(), std::max(params.gate_m, params.spacing_m) + 0.5 * params.spacing_m),
               MapChains::tile_m(params.spacing_m, params.max_gap_m)),
      chains_(params.spacing_m, params.max_gap_m, params.tolerance_m),
      now_(2.0 * params.spacing_m, params.pass_margin_m) {
  confirmation_log_odds_ = std::log(params_.confirmation_probability / (1.0 - params_.confirmation_probability));
  look_ns_.fill(std::numeric_limits<std::int64_t>::min());
  watches_.resize(kWatches);
  for (std::vector<Index>* list : {&given_up_, &unsettled_, &passed_}) list->reserve(kUsualRoom);
}

void PolygonMap::begin_anew(std::int64_t stamp_ns, std::uint64_t next_id) {
  stamp_ns_ = made_ns_ = stamp_ns;
  waited_s_ = 0.0;
  next_watch_ = next_look_ = 0;
  looks_ = 0.0;
  look_ns_.fill(std::numeric_limits<std::int64_t>::min());
  std::fill(watches_.begin(), watches_.end(), ScanView());
  unsettled_.clear();
  surfels_.clear();
  chains_.begin_anew(next_id);
}

void PolygonMap::reset() { begin_anew(std::numeric_limits<std::int64_t>::min(), 1); }

void PolygonMap::restore(const Polygons& polygons) {
  const std::vector<Surfel> surfels = surfels_along(polygons, params_.spacing_m);
  std::uint64_t next_id = 1;
  for (const Chain& chain : polygons.chains) next_id = std::max(next_id, chain.id + 1);
  begin_anew(polygons.stamp_ns, next_id);
  for (const Surfel& surfel : surfels) {
    const Index index = surfels_.add(surfel);
    most_extent_m_ = std::max(most_extent_m_, surfel.high_m);
    if (surfel.log_odds < 0.0) unsettled_.push_back(index);
  }
}

PolygonMap::Index PolygonMap::add(const Surfel& surfel) {
  const Index index = surfels_.add(surfel);
  chains_.touch(index);
  if (!surfel.confirmed) unsettled_.push_back(index);
  return index;
}

void PolygonMap::remove(Index index) {
  chains_.remove(surfels_, index);
  surfels_.remove(index);
}

/// The element at the place of a hit, corrected by it; a new one where there is none.
PolygonMap::Index PolygonMap::fuse(const Eigen::Vector2d& p_world_m, const Eigen::Vector2d& normal_world,
                                   double variance_m2, bool has_normal, bool may_create) {
  const double least_cosine = has_normal ? kFaces : kVisible;
  const double half_m = 0.5 * params_.spacing_m;
  Index best = kNone, double_of_it = kNone;
  double least = std::numeric_limits<double>::infinity();
  Neighbours beside;
  beside.right_m = beside.left_m = kBetween * params_.spacing_m;
  surfels_.for_each_near(p_world_m, std::max(params_.gate_m, beside.left_m), [&](Index i, const Surfel& surfel) {
    if (surfel.normal_world.dot(normal_world) < (surfel.oriented ? least_cosine : kVisible)) return;
    const Eigen::Vector2d d_m = p_world_m - surfel.p_world_m;
    const double gate_m = std::min(params_.gate_m, kGateSigmas * std::sqrt(surfel.variance_m2 + variance_m2));
    const Eigen::Vector2d& normal = surfel.oriented ? surfel.normal_world : normal_world;
    const double across = normal.dot(d_m) / gate_m;
    if (std::abs(across) > 1.0) return;
    const double along_m = normal.y() * d_m.x() - normal.x() * d_m.y();
    if (std::abs(along_m) > half_m) {
      if (along_m > 0.0 && along_m < beside.right_m) beside.right = i, beside.right_m = along_m;
      if (along_m < 0.0 && -along_m < beside.left_m) beside.left = i, beside.left_m = -along_m;
      return;
    }
    double score = across * across + along_m * along_m / (half_m * half_m);
    if (!has_normal) score += kFewHitsPenalty / std::sqrt(surfel.hits);
    if (score < least) {
      least = score;
      double_of_it = best;
      best = i;
    } else {
      double_of_it = i;
    }
  });
  if (best == kNone) {
    const Index on_line = of_line(beside);
    if (on_line != kNone) {
      see(surfels_[on_line], true);
      chains_.touch(on_line);
      return on_line;
    }
  }
  if (best == kNone && !may_create) return kNone;
  if (best == kNone) return create(p_world_m, normal_world, variance_m2, has_normal, beside);
  correct(best, p_world_m, normal_world, variance_m2, has_normal);
  if (double_of_it != kNone &&
      std::abs(between_m(surfels_[best], surfels_[double_of_it])) <= kSamePlace * params_.spacing_m) {
    // A known one stays where it is: its distance from those beside it is right.
    if (surfels_[double_of_it].confirmed && !surfels_[best].confirmed) std::swap(best, double_of_it);
    merge_double(best, double_of_it);
  }
  return best;
}

/// On the straight way between two elements that stand for all of it none is missing: the nearer one of them.
PolygonMap::Index PolygonMap::of_line(const Neighbours& beside) const {
  if (beside.right == kNone || beside.left == kNone) return kNone;
  if (beside.right_m + beside.left_m > kFilled * params_.spacing_m) return kNone;
  const Surfel &right = surfels_[beside.right], &left = surfels_[beside.left];
  if (!right.confirmed || !left.confirmed || right.normal_world.dot(left.normal_world) < kStraight) return kNone;
  return beside.right_m < beside.left_m ? beside.right : beside.left;
}

/// A map that a file can hold.
bool PolygonMap::is_full() const { return elements() >= kMaxElements; }

/// Between two known elements a new one begins with what these know.
PolygonMap::Index PolygonMap::create(const Eigen::Vector2d& p_world_m, const Eigen::Vector2d& normal_world,
                                     double variance_m2, bool has_normal, const Neighbours& beside) {
  if (is_full()) return kNone;
  Surfel surfel;
  surfel.p_world_m = p_world_m;
  surfel.normal_world = normal_world;
  surfel.oriented = has_normal;
  surfel.variance_m2 = variance_m2;
  surfel.log_odds = kFirstHit;
  surfel.first_seen_ns = surfel.last_seen_ns = stamp_ns_;
  surfel.hits = 1;
  if (beside.right == kNone || beside.left == kNone ||
      surfels_[beside.right].normal_world.dot(surfels_[beside.left].normal_world) < kOneSurface) {
    surfel.watched = was_watched(p_world_m);
    return add(surfel);
  }
  const Surfel& right = surfels_[beside.right];
  const Surfel& left = surfels_[beside.left];
  surfel.normal_world = (right.normal_world + left.normal_world).normalized();
  surfel.oriented = right.oriented || left.oriented;
  const double link_variance_m2 = std::max(right.variance_m2, left.variance_m2) + kBulgeVariance_m2;
  const double gain = link_variance_m2 / (link_variance_m2 + variance_m2);
  surfel.variance_m2 = gain * variance_m2;
  surfel.watched = right.watched && left.watched;
  surfel.confirmed = right.confirmed && left.confirmed;
  surfel.log_odds = std::max(kFirstHit, std::min(right.log_odds, left.log_odds));
  surfel.chain = right.chain == left.chain ? right.chain : 0;
  // Across the link only: along it the hit is where it is.
  const double part = beside.right_m / (beside.right_m + beside.left_m);
  const Eigen::Vector2d on_link_m = right.p_world_m + part * (left.p_world_m - right.p_world_m);
  surfel.p_world_m = on_link_m + gain * (p_world_m - on_link_m);
  return add(surfel);
}

void PolygonMap::correct(Index index, const Eigen::Vector2d& p_world_m, const Eigen::Vector2d& normal_world,
                         double variance_m2, bool has_normal) {
  Surfel& surfel = surfels_[index];
  if (!surfel.oriented && has_normal) {
    surfel.oriented = true;
    surfel.normal_world = normal_world;
  }
  const Eigen::Vector2d d_m = p_world_m - surfel.p_world_m;
  const double gain = surfel.variance_m2 / (surfel.variance_m2 + variance_m2);
  const double along_m = surfel.along_world().dot(d_m);
  if (has_normal) {  // else it may be of another surface
    const double step_m = std::max(kExtentStep_m, params_.spacing_m / (surfel.hits + 1));
    surfel.high_m = std::max(surfel.high_m + (along_m > surfel.high_m ? kInside : kInside - 1.0) * step_m, 0.0);
    surfel.low_m = std::min(surfel.low_m - (along_m < surfel.low_m ? kInside : kInside - 1.0) * step_m, 0.0);
    most_extent_m_ = std::max({most_extent_m_, surfel.high_m, -surfel.low_m});
  }
  surfel.variance_m2 = std::max((1.0 - gain) * surfel.variance_m2, kLeastVariance_m2);
  const Eigen::Vector2d moved_m = surfel.p_world_m + gain * surfel.normal_world.dot(d_m) * surfel.normal_world;
  const double turn = std::max(kTurnGain, 1.0 / (surfel.hits + 1.0));
  if (has_normal) {
    surfel.normal_world = (surfel.normal_world + turn * (normal_world - surfel.normal_world)).normalized();
  }
  const bool of_surface = has_normal || !surfel.oriented;  // else it may be of another one
  if (of_surface) count_more(surfel.hits);
  see(surfel, of_surface);
  surfels_.move(index, moved_m);
  chains_.touch(index);
}

/// What the latest scan tells, in independent looks.
double PolygonMap::looks() const { return std::min(step_s_ / kLook_s, 1.0); }

void PolygonMap::count_look() {
  looks_ += looks();
  if (looks_ < 1.0) return;
  looks_ -= 1.0;
  look_ns_[next_look_] = stamp_ns_;
  next_look_ = (next_look_ + 1) % look_ns_.size();
}

/// That the latest scan hit it.
void PolygonMap::see(Surfel& surfel, bool of_surface) const {
  if (surfel.last_seen_ns == stamp_ns_) return;
  surfel.log_odds = std::min(surfel.log_odds + kHitLook * looks(), Surfel::kMostLogOdds);
  if (of_surface) surfel.seen_s += step_s_;
  surfel.last_seen_ns = stamp_ns_;
}

/// Two elements at one place of the same boundary: errors of poses made two of one.
void PolygonMap::merge_double(Index kept, Index other) {
  Surfel& surfel = surfels_[kept];
  const Surfel& lost = surfels_[other];
  const Eigen::Vector2d d_m = lost.p_world_m - surfel.p_world_m;
  const double part = surfel.variance_m2 / (surfel.variance_m2 + lost.variance_m2);
  surfel.first_seen_ns = std::min(surfel.first_seen_ns, lost.first_seen_ns);
  surfel.last_seen_ns = std::max(surfel.last_seen_ns, lost.last_seen_ns);
  count_more(surfel.hits, lost.hits);
  surfel.seen_s = std::max(surfel.seen_s, lost.seen_s);
  surfel.confirmed |= lost.confirmed;
  surfel.watched &= lost.watched;
  surfel.log_odds = std::max(surfel.log_odds, lost.log_odds);
  if (surfel.chain == 0) surfel.chain = lost.chain;
  const Eigen::Vector2d moved_m = surfel.p_world_m + part * surfel.normal_world.dot(d_m) * surfel.normal_world;
  remove(other);
  surfels_.move(kept, moved_m);
  chains_.touch(kept);
}

/// Whether something came to this place while it was seen to be free.
bool PolygonMap::was_watched(const Eigen::Vector2d& p_world_m) const {
  int passed = 0;
  for (const ScanView& watch : watches_) {
    if (!watch.is_known()) continue;
    double weight = 0.0;
    const ScanView::Seen seen = watch.see(watch.T_level_world() * p_world_m, kNearWatched_m, ScanView::kWideThing_m,
                                          params_.pass_margin_m, &weight);
    if (seen == ScanView::Seen::kHit && seconds_between(watch.stamp_ns(), stamp_ns_) > kThereBefore_s) return false;
    if (seen == ScanView::Seen::kPassed && weight > ScanView::kNoReturnWeight) ++passed;
  }
  return passed >= kWatchedBy;
}

void PolygonMap::remember() {
  const ScanView& last = watches_[(next_watch_ + kWatches - 1) % kWatches];
  if (last.is_known() && seconds_between(last.stamp_ns(), stamp_ns_) < kWatchStep_s) return;
  watches_[next_watch_] = now_;
  next_watch_ = (next_watch_ + 1) % kWatches;
}

/// Elements whose place beams have passed lose existence, hidden ones never. Beams reach those near the sensor only;
/// elsewhere only those have to be looked at that do not stay by themselves.
void PolygonMap::see_through(PolygonMapUpdate& update) {
  const double rate = looks() * kLook_s * Surfel::kMostLogOdds / params_.removal_s;
  const Eigen::Matrix2d R_level_world = now_.T_level_world().rotation();
  passed_.clear();
  const auto is_forgotten = [&](const Surfel& surfel) {
    return !surfel.confirmed && surfel.last_seen_ns < look_ns_[next_look_];
  };
  surfels_.for_each_tile(inverse(now_.T_level_world()).translation_m, now_.most_m(), [&](Surfels::Tile tile) {
    if (now_.is_hidden(surfels_.middle_world_m(tile), surfels_.tile_radius_m(), most_extent_m_)) return;
    surfels_.for_each_of(tile, [&](Index i) {
      Surfel& surfel = surfels_[i];
      if (surfel.last_seen_ns == stamp_ns_) return;
      const double weight = now_.passing_weight(surfel, R_level_world);
      if (weight > 0.0) {
        surfel.log_odds -= rate * weight;
        chains_.touch(i);
      }
      if (surfel.log_odds < 0.0 || is_forgotten(surfel)) passed_.push_back(i);
    });
  });
  const auto is_settled = [&](Index i) {
    const Surfel& surfel = surfels_[i];
    if (!surfel.alive || (surfel.confirmed && surfel.log_odds >= 0.0)) return true;
    if (surfel.last_seen_ns != stamp_ns_ && (surfel.log_odds < 0.0 || is_forgotten(surfel))) passed_.push_back(i);
    return false;
  };
  unsettled_.erase(std::remove_if(unsettled_.begin(), unsettled_.end(), is_settled), unsettled_.end());
  std::sort(passed_.begin(), passed_.end());
  passed_.erase(std::unique(passed_.begin(), passed_.end()), passed_.end());
  for (const Index i : passed_) {
    // What was never confirmed and is passed, too, was not seen again.
    ++update.reasons[is_forgotten(surfels_[i]) ? "not seen again" : "passed by beams"];
    remove(i);
    ++update.removed;
  }
}

/// Elements of the outer boundary of what has left. Those that the scan hits are of something else, or it still covers
/// them; those that face its middle are of what is beside it.
void PolygonMap::give_up(const MoverTrace& trace, PolygonMapUpdate& update) {
  given_up_.clear();
  const Eigen::Vector2d& center_m = trace.outline.center_world_m();
  surfels_.for_each_near(center_m, trace.outline.reach_m(), [&](Index index, const Surfel& surfel) {
    if (surfel.first_seen_ns < trace.since_ns || surfel.last_seen_ns == stamp_ns_) return;
    if (!trace.outline.covers(surfel.p_world_m)) return;
    if (surfel.normal_world.dot(surfel.p_world_m - center_m) <= 0.0) return;
    double weight = 0.0;
    const Eigen::Vector2d p_level_m = now_.T_level_world() * surfel.p_world_m;
    const bool is_hit =
        now_.see(p_level_m, kLeft_m, ScanView::kWideThing_m, params_.pass_margin_m, &weight) == ScanView::Seen::kHit;
    if (is_hit) return;
    given_up_.push_back(index);
  });
  for (const Index index : given_up_) remove(index);
  update.removed += static_cast<int>(given_up_.size());
  if (!given_up_.empty()) update.reasons["of a thing that set off"] += given_up_.size();
}

void PolygonMap::fuse_hits(const Polylines& polylines, const Eigen::Matrix3d& pose_covariance, const Movers& movers,
                           PolygonMapUpdate& report) {
  const Pose2& T_world_level = polylines.T_world_level;
  const Eigen::Matrix2d R_world_level = T_world_level.rotation();
  assign_with_room(of_hit_, polylines.hits.size(), kNone);
  const std::size_t before = elements();
  for (std::size_t i = 0; i < polylines.hits.size(); ++i) {
    const PolylineHit& hit = polylines.hits[i];
    const Eigen::Vector2d normal_world = R_world_level * hit.normal_level;
    const Eigen::Vector2d offset_m = R_world_level * hit.p_level_m;
    if (movers.cover(offset_m + T_world_level.translation_m)) {
      ++report.on_movers;
      continue;
    }
    Eigen::Vector3d by_pose;
    by_pose << normal_world, normal_world.dot(Eigen::Vector2d(-offset_m.y(), offset_m.x()));
    const double variance_m2 =
        std::clamp(hit.sigma_m * hit.sigma_m + by_pose.dot(pose_covariance * by_pose), kLeastHit_m2, kMostHit_m2);
    of_hit_[i] = fuse(offset_m + T_world_level.translation_m, normal_world, variance_m2, hit.has_normal,
                      hit.has_normal || !hit.is_behind_beside);
    if (of_hit_[i] == kNone) ++report.reasons[is_full() ? "map is full" : "perhaps between two surfaces"];
  }
  report.created = static_cast<int>(elements() - before);
  report.fused = static_cast<int>(polylines.hits.size()) - report.on_movers - report.created;
}

/// Those elements that the scan hit and that surely exist.
void PolygonMap::confirm_hit() {
  for (const Index index : of_hit_) {
    if (index == kNone) continue;
    Surfel& surfel = surfels_[index];
    if (!surfel.alive || surfel.confirmed) continue;
    if (surfel.log_odds < confirmation_log_odds_ || (surfel.watched && surfel.seen_s < params_.park_s)) continue;
    const Index known = known_at(surfels_, index, params_);
    surfel.confirmed = known == kNone;
    if (known != kNone) merge_double(known, index);
  }
}

PolygonMapUpdate PolygonMap::update(const Polylines& polylines, const Eigen::Matrix3d& pose_covariance,
                                    const Movers& movers, PolygonMapUpdate memory) {
  PolygonMapUpdate report = std::move(memory);
  report.fused = report.created = report.removed = report.on_movers = 0;
  report.reasons.reset();
  if (stamp_ns_ != std::numeric_limits<std::int64_t>::min() && polylines.stamp_ns <= stamp_ns_) {
    ++report.reasons["stamp not after the one before"];
    return report;
  }
  step_s_ =
      stamp_ns_ == std::numeric_limits<std::int64_t>::min() ? 0.0 : seconds_between(stamp_ns_, polylines.stamp_ns);
  stamp_ns_ = polylines.stamp_ns;
  if (step_s_ > kAbsence_s) {
    for (ScanView& watch : watches_) watch.forget();
    step_s_ = kAbsence_s;
  }
  count_look();
  const double pose_variance_m2 = std::max(pose_covariance(0, 0), pose_covariance(1, 1));
  if (pose_variance_m2 > params_.max_pose_sigma_m * params_.max_pose_sigma_m ||
      pose_covariance(2, 2) > params_.max_pose_sigma_rad * params_.max_pose_sigma_rad) {
    ++report.reasons["pose not known well enough"];
    return report;
  }
  waited_s_ += step_s_;
  now_.set_errors(polylines.resolution_rad,
                  std::sqrt(polylines.range_sigma_m * polylines.range_sigma_m + pose_variance_m2));

  fuse_hits(polylines, pose_covariance, movers, report);
  now_.set(stamp_ns_, inverse(polylines.T_world_level), polylines.free_space);
  see_through(report);
  for (const MoverTrace& trace : movers.traces) give_up(trace, report);
  confirm_hit();
  remember();
  return report;
}

const ChainChanges& PolygonMap::update_chains() {
  made_ns_ = stamp_ns_;
  const double step_s = std::exchange(waited_s_, 0.0);
  return chains_.update(surfels_, stamp_ns_,
                        {inverse(now_.T_level_world()).translation_m, now_.resolution_rad(), step_s});
}

const ChainChanges& PolygonMap::update_due_chains() {
  const bool are_old =
      made_ns_ == std::numeric_limits<std::int64_t>::min() || stamp_ns_ - made_ns_ >= nanoseconds(params_.refresh_s);
  return are_old || chains_.are_due(surfels_, stamp_ns_) ? update_chains() : chains_.no_changes();
}

Polygons PolygonMap::polygons(Polygons memory) {
  update_chains();
  return latest_polygons(std::move(memory));
}

Polygons PolygonMap::latest_polygons(Polygons memory) {
  Polygons result = std::move(memory);
  result.stamp_ns = stamp_ns_;
  result.chains = chains_.list(std::move(result.chains));
  return result;
}

std::optional<MappedElement> PolygonMap::find_facing(const Eigen::Vector2d& p_world_m,
                                                     const Eigen::Vector2d& normal_world, double reach_m) const {
  return find_facing(p_world_m, normal_world, reach_m, std::numeric_limits<std::int64_t>::min(),
                     std::numeric_limits<std::int64_t>::max());
}

std::optional<MappedElement> PolygonMap::find_facing(const Eigen::Vector2d& p_world_m,
                                                     const Eigen::Vector2d& normal_world, double reach_m,
                                                     std::int64_t from_ns, std::int64_t to_ns) const {
  double least_m = reach_m;
  Index nearest = kNone;
  surfels_.for_each_near(p_world_m, reach_m, [&](Index i, const Surfel& surfel) {
    if (!surfel.confirmed || surfel.normal_world.dot(normal_world) < kOneSurface) return;
    if (surfel.last_seen_ns < from_ns || surfel.last_seen_ns > to_ns) return;
    const Eigen::Vector2d d_m = p_world_m - surfel.p_world_m;
    const double across_m = std::abs(surfel.normal_world.dot(d_m));
    if (across_m >= least_m || std::abs(surfel.along_world().dot(d_m)) > params_.spacing_m) return;
    least_m = across_m;
    nearest = i;
  });
  if (nearest == kNone) return std::nullopt;
  const Surfel& surfel = surfels_[nearest];
  return MappedElement{
      {surfel.p_world_m, surfel.along_world(), surfel.variance_m2, 0.0, 0.0}, surfel.last_seen_ns, drawn_ns(surfel)};
}

void PolygonMap::deform(const std::function<Pose2(std::int64_t drawn_ns)>& motion) {
  for (Index i = 0; i < surfels_.end(); ++i) {
    Surfel& surfel = surfels_[i];
    if (!surfel.alive) continue;
    const Pose2 moved = motion(drawn_ns(surfel));
    surfel.normal_world = moved.rotation() * surfel.normal_world;
    surfels_.move(i, moved * surfel.p_world_m);
  }
  chains_.touch_all();
}

/// The older one of two is kept.
void PolygonMap::merge_doubles(double across_m) {
  for (Index i = 0; i < surfels_.end(); ++i) {
    const Surfel own = surfels_[i];
    if (!own.alive) continue;
    given_up_.clear();
    surfels_.for_each_near(own.p_world_m, across_m + params_.spacing_m, [&](Index j, const Surfel& other) {
      if (j == i || other.normal_world.dot(own.normal_world) < kOneSurface) return;
      if (std::abs(own.normal_world.dot(other.p_world_m - own.p_world_m)) > across_m) return;
      if (std::abs(between_m(own, other)) <= 0.5 * params_.spacing_m) given_up_.push_back(j);
    });
    for (const Index j : given_up_) merge_double(i, j);
  }
}

void PolygonMap::give_up_behind(const Eigen::Vector2d& p_world_m, const Eigen::Vector2d& normal_world, double least_m,
                                double most_m, std::int64_t before_ns) {
  given_up_.clear();
  surfels_.for_each_near(p_world_m, most_m, [&](Index i, const Surfel& surfel) {
    if (surfel.last_seen_ns >= before_ns || surfel.normal_world.dot(normal_world) < kOneSurface) return;
    const Eigen::Vector2d d_m = p_world_m - surfel.p_world_m;
    const double behind_m = normal_world.dot(d_m), along_m = normal_world.x() * d_m.y() - normal_world.y() * d_m.x();
    if (behind_m < least_m || behind_m > most_m || std::abs(along_m) > params_.spacing_m) return;
    given_up_.push_back(i);
  });
  for (const Index i : given_up_) remove(i);
}

void PolygonMap::elements_of(std::size_t chain, std::vector<BoundaryElement>& elements) const {
  chains_.elements_of(surfels_, chain, elements);
}

}  // namespace situation_awareness

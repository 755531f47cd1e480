// SPDX-License-Identifier: BSD-3-Clause
#include "situation_awareness/pipeline/moving_objects.hpp"

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <optional>

#include "situation_awareness/common/time.hpp"
#include "situation_awareness/common/usual_room.hpp"

namespace situation_awareness {
namespace {

// Where no source is named, none is recorded; the sensitivity of these was not measured.

/// m. An object moves once it has travelled so far, and three standard deviations of its position.
constexpr double kMinTravel_m = 0.25;
/// m/s. An object that is slower stands.
constexpr double kMinSpeed_m_s = 0.1;

/// Probability of moving from which on an element surely moves, and that down to which it goes on.
constexpr double kSurelyMoves = 0.95;
constexpr double kStillMoves = 0.5;
/// Of a velocity that is none of noise: the 95 % quantile of chi-square with two degrees of freedom. That it moves is
/// in p_moving, and in its way.
constexpr double kFast = 6.0;
/// Standard deviations of the position that a mover has travelled, and of the outline in the margin.
constexpr double kTravelSigmas = 3.0;
constexpr double kMarginSigmas = 2.0;
/// m. What is less certain than this is not masked as a whole.
constexpr double kMostMargin_m = 0.3;
/// m. The legs of who walks are so far beside the circle that stands for a person (docs/math/people.md: the standard
/// deviation of a leg's way from the middle is 0.18 m, its radius 0.06 m, that of the circle 0.2 m).
constexpr double kLegsBeside_m = 0.2;
/// s. Its places are remembered at this distance, 2.5 s in all.
constexpr double kPlaceStep_s = 0.25;
/// m. A beam that ends so far before the back of an outline ends on it, as one that ends so far before its front; three
/// standard deviations of a scanner's noise of 12 mm. Beams that cross it for less than twice that do not tell.
constexpr double kThrough_m = 0.04;
/// Beams that end on something, at least.
constexpr int kStillHit = 3;
/// m. The boundary on a map is so near to the outline of a thing.
constexpr double kTraceMargin_m = 0.06;
/// s. Its boundary may have come to a map so long before it was detected.
constexpr double kSeenBefore_s = 0.5;
/// s. What was seen to stand for so long has a place where it stood.
constexpr double kStood_s = 1.0;
/// s. For so long after it has set off that place is given up.
constexpr double kGiveUp_s = 3.0;
/// s. A mover that is not on the map of objects for so long is where it would be: one scan may miss it. What was off
/// the map for longer may be another thing.
constexpr double kMissing_s = 0.4;
/// s. An element that appears where a mover was so long ago is that one.
constexpr double kSuccession_s = 2.0;
/// s. One that was off the map for longer is another.
constexpr double kForgotten_s = 20.0;

/// Of both directions together; not below zero.
double position_variance_m2(const Object& object) {
  return std::max(object.covariance.block<2, 2>(object_error::kPosition, object_error::kPosition).trace(), 0.0);
}

}  // namespace

MovingObjects::MovingObjects(const MoverParams& params) : params_(params) {
  params_.validate();
  followed_.reserve(kUsualRoom);
  movers_.outlines.reserve(kUsualRoom);
  movers_.traces.reserve(kUsualRoom * 2);
}

void MovingObjects::reset() {
  followed_.clear();
  stamp_ns_ = kNever;
}

bool MovingObjects::is_mover(const Followed& followed) const {
  return followed.moved_ns != kNever && seconds_between(followed.moved_ns, stamp_ns_) < params_.parked_after_s;
}

bool MovingObjects::is_fast(const Object& object) const {
  const Eigen::Vector2d& v = object.velocity_world_m_s;
  if (v.norm() < kMinSpeed_m_s) return false;
  const Eigen::Matrix2d P = object.covariance.block<2, 2>(object_error::kVelocity, object_error::kVelocity);
  // v' P^-1 v > q, without a division by a determinant that may be zero.
  const double across = P(1, 1) * v.x() * v.x() - 2.0 * P(0, 1) * v.x() * v.y() + P(0, 0) * v.y() * v.y();
  return across > kFast * (P(0, 0) * P(1, 1) - P(0, 1) * P(0, 1));
}

MoverOutline MovingObjects::outline_of(const Object& object) const {
  const double variance_m2 =
      object.covariance.block<2, 2>(object_error::kPosition, object_error::kPosition).diagonal().maxCoeff() +
      object.covariance.block<2, 2>(object_error::kRadii, object_error::kRadii).diagonal().maxCoeff();
  const double margin_m =
      std::min(params_.margin_m + kMarginSigmas * std::sqrt(std::max(variance_m2, 0.0)), kMostMargin_m);
  if (object.object_class == ObjectClass::kPerson) return {object.ellipse_world, margin_m + kLegsBeside_m};
  if (object.shape == Shape::kBox) return {object.box_world, margin_m};
  return {object.ellipse_world, margin_m};
}

MoverOutline MovingObjects::trace_of(const Object& object) const {
  if (object.object_class == ObjectClass::kPerson) return outline_of(object);
  if (object.shape == Shape::kBox) return {object.box_world, kTraceMargin_m};
  return {object.ellipse_world, kTraceMargin_m};
}

MovingObjects::Followed& MovingObjects::find_or_add(const Object& object) {
  const auto place = std::lower_bound(followed_.begin(), followed_.end(), object.id,
                                      [](const Followed& followed, std::uint64_t id) { return followed.id < id; });
  if (place != followed_.end() && place->id == object.id) return *place;
  Followed added;
  added.id = object.id;
  added.first_seen_ns = object.first_seen_ns;
  begin_way(added, object);
  // A mover that has got another id.
  for (const Followed& other : followed_) {
    if (!is_mover(other) || seconds_between(other.listed_ns, stamp_ns_) > kSuccession_s) continue;
    if (!other.outline.covers(object.ellipse_world.center_m)) continue;
    added.moved_ns = std::max(added.moved_ns, other.moved_ns);
    added.first_seen_ns = std::min(added.first_seen_ns, other.first_seen_ns);
  }
  return *followed_.insert(place, added);
}

void MovingObjects::remember_place(Followed& followed) const {
  if (followed.place_ns != kNever && seconds_between(followed.place_ns, stamp_ns_) < kPlaceStep_s) return;
  followed.places[followed.next_place] = {followed.trace, followed.first_seen_ns - nanoseconds(kSeenBefore_s)};
  followed.next_place = (followed.next_place + 1) % kPlaces;
  followed.places_known = std::min(followed.places_known + 1, kPlaces);
  followed.place_ns = stamp_ns_;
}

void MovingObjects::begin_way(Followed& followed, const Object& object) const {
  followed.began_world_m = object.ellipse_world.center_m;
  followed.began_variance_m2 = position_variance_m2(object);
  followed.began = trace_of(object);
}

/// Under this id there is perhaps another thing, elsewhere: what is between is no way, and where the one stood was not
/// left by the other. A mover that was hidden is one still.
void MovingObjects::forget_way(Followed& followed, const Object& object) const {
  followed.moves = false;
  begin_way(followed, object);
  followed.stands_since_ns = kNever;
  followed.stood.since_ns = kNever;
  if (!is_mover(followed)) followed.places_known = followed.next_place = 0;
}

/// Whether more beams end where its way began than go through, apart from those that end on it now. From another side,
/// or where a part of it comes into view, the outline of what stands seems to move.
bool MovingObjects::is_still_there(const Followed& followed, const FreeSpace& free_space, const Pose2& T_world_level) {
  const Eigen::Matrix2d R_world_level = T_world_level.rotation();
  const Eigen::Vector2d& from_m = T_world_level.translation_m;
  int on_it = 0, through = 0;
  for (std::size_t i = 0; i < free_space.range_m.size(); ++i) {
    const double range_m = free_space.range_m[i], azimuth_rad = free_space.azimuth_rad[i];
    if (range_m <= 0.0) continue;
    const Eigen::Vector2d u = R_world_level * Eigen::Vector2d(std::cos(azimuth_rad), std::sin(azimuth_rad));
    const std::optional<MoverOutline::Crossing> crossing = followed.began.crossing(from_m, u);
    if (!crossing || crossing->exit_m - crossing->entry_m < 2.0 * kThrough_m) continue;
    if (range_m < crossing->entry_m - kThrough_m || followed.trace.covers(from_m + range_m * u)) continue;
    ++(range_m > crossing->exit_m - kThrough_m ? through : on_it);
  }
  return on_it >= kStillHit && on_it > through;
}

void MovingObjects::follow(Followed& followed, const Object& object, const FreeSpace& free_space,
                           const Pose2& T_world_level) {
  const Eigen::Vector2d& center_m = object.ellipse_world.center_m;
  if (followed.listed_ns != kNever && seconds_between(followed.listed_ns, stamp_ns_) > kMissing_s) {
    forget_way(followed, object);
  }
  followed.listed_ns = stamp_ns_;
  followed.outline = outline_of(object);
  followed.velocity_world_m_s = object.velocity_world_m_s;
  // Where it is not seen it is predicted, which tells nothing new.
  if (object.last_seen_ns < stamp_ns_) return;

  const double variance_m2 = position_variance_m2(object);
  if (object.p_moving < kStillMoves || !is_fast(object)) {
    followed.moves = false;
    // The map of objects tells that a box moves when it has travelled.
    begin_way(followed, object);
    if (followed.stands_since_ns == kNever) followed.stands_since_ns = stamp_ns_;
  } else {
    followed.stands_since_ns = kNever;
    if (!followed.moves && object.p_moving > kSurelyMoves) {
      followed.moves = true;
      if (object.shape != Shape::kBox) begin_way(followed, object);
    }
  }
  followed.trace = trace_of(object);
  followed.is_person = object.object_class == ObjectClass::kPerson;
  if (followed.stands_since_ns != kNever && seconds_between(followed.stands_since_ns, stamp_ns_) >= kStood_s) {
    followed.stood.outline = followed.trace;
    followed.stood.since_ns = stamp_ns_;
  }
  if (followed.moves) {
    const bool is_one = is_mover(followed);
    const double sigma_m = std::sqrt(followed.began_variance_m2 + variance_m2);
    bool has_travelled = (center_m - followed.began_world_m).norm() >= std::max(kMinTravel_m, kTravelSigmas * sigma_m);
    if (has_travelled && !is_one && is_still_there(followed, free_space, T_world_level)) {
      has_travelled = false;
      begin_way(followed, object);
    }
    if (has_travelled && !is_one) {
      followed.set_off_ns = stamp_ns_;
      ++set_off_;
      // What stood may be on the map since long before it was first seen by this one of objects. A person is not.
      if (followed.stood.since_ns != kNever && !followed.is_person) {
        for (MoverTrace& trace : followed.places) trace.since_ns = kNever;
      }
    }
    if (has_travelled || is_one) followed.moved_ns = stamp_ns_;
  }
  remember_place(followed);
}

void MovingObjects::add(const Objects& objects, const FreeSpace& free_space, const Pose2& T_world_level) {
  if (objects.stamp_ns < stamp_ns_) reset();
  stamp_ns_ = objects.stamp_ns;
  for (const Object& object : objects.objects) {
    follow(find_or_add(object), object, free_space, T_world_level);
  }
  followed_.erase(std::remove_if(followed_.begin(), followed_.end(),
                                 [&](const Followed& followed) {
                                   return seconds_between(followed.listed_ns, stamp_ns_) > kForgotten_s;
                                 }),
                  followed_.end());
}

const Movers& MovingObjects::at(std::int64_t stamp_ns) {
  movers_.outlines.clear();
  movers_.traces.clear();
  for (const Followed& followed : followed_) {
    if (!is_mover(followed)) continue;
    const double age_s = seconds_between(followed.listed_ns, stamp_ns);
    if (age_s < 0.0 || age_s > kMissing_s) continue;
    MoverOutline outline = followed.outline;
    outline.move(age_s * followed.velocity_world_m_s);
    movers_.outlines.push_back(outline);
    for (std::size_t i = 0; i < followed.places_known; ++i) movers_.traces.push_back(followed.places[i]);
    if (followed.stood.since_ns != kNever && followed.set_off_ns != kNever &&
        seconds_between(followed.set_off_ns, stamp_ns) < kGiveUp_s) {
      movers_.traces.push_back(
          {followed.stood.outline, followed.is_person ? followed.first_seen_ns - nanoseconds(kSeenBefore_s) : kNever});
    }
  }
  return movers_;
}

std::size_t MovingObjects::count() const {
  return static_cast<std::size_t>(std::count_if(followed_.begin(), followed_.end(), [this](const Followed& followed) {
    return followed.listed_ns == stamp_ns_ && is_mover(followed);
  }));
}

}  // namespace situation_awareness

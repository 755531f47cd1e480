// SPDX-License-Identifier: BSD-3-Clause
#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <utility>

#include "people_parts.hpp"
#include "situation_awareness/common/count.hpp"
#include "situation_awareness/common/time.hpp"
#include "situation_awareness/geometry/angles.hpp"
#include "situation_awareness/map/objects/association.hpp"
#include "situation_awareness/map/objects/re_identification.hpp"
#include "situation_awareness/map/objects/shape_belief.hpp"

// Which leg-sized elements become a person.
namespace situation_awareness {

using namespace object_state;

namespace {

// Each constant with its unit and its source (docs/math/people.md, "Constants").

/// m. Distance of the legs of who stands, at least.
constexpr double kMinStanding_m = 0.08;
/// m. The same, at most.
constexpr double kMaxStanding_m = 0.38;
/// m. Radius of a leg of who stands, at least.
constexpr double kMinStandingLeg_m = 0.03;
/// m. The same, at most.
constexpr double kMaxStandingLeg_m = 0.1;
/// m. The legs of a person who has just come into view are so near to each other, and one moves.
constexpr double kMaxStep_m = 0.75;
/// Probability of moving from which on it does.
constexpr double kMoves = 0.8;
/// s. Age from which on the time of standing tells of gait.
constexpr double kMinAge_s = 0.5;
/// Part of its age. What has stood for longer is no leg of who walks.
constexpr double kMaxStoodPart = 0.8;
/// Ratio of the distance to the next such thing to that of the two.
constexpr double kAlone = 1.8;
/// Log-odds that two leg-sized elements are the legs of one person, at first.
constexpr double kPairAtFirst = -1.0;
/// The most that these log-odds become.
constexpr double kMaxPair = 1.0;
/// Added by a scan that shows them as those of who stands.
constexpr double kPairStanding = 0.75;
/// Added per second of gait.
constexpr double kPairGait_1_s = 6.0;
/// Taken per second without either.
constexpr double kPairDecay_1_s = 1.0;
/// Added per metre of a step about a leg that stands.
constexpr double kPairStep_1_m = 4.0;
/// m. One leg has stepped if the way to it has changed by so much.
constexpr double kMinStep_m = 0.1;
/// Log-odds of the class of a person who only stood.
constexpr double kClassStanding = 0.4;
/// Added to it per second of gait.
constexpr double kClassGait_1_s = 1.5;
/// The most that the log-odds of a class become.
constexpr double kMaxClass = 4.6;
/// Speed of who walks, at least.
constexpr double kGaitSpeed_m_s = 0.2;
/// m. What is so near to a leg-sized thing is beside it.
constexpr double kBeside_m = 0.4;
/// m. What is so near to the middle of two elements is between them.
constexpr double kBetween_m = 0.05;

double class_probability(double log_odds) { return probability(std::min(log_odds, kMaxClass)); }

/// Log-likelihood of a shape as it was expected: that of what says nothing of its shape.
double log_likelihood_of_shape() { return -1.5 * std::log(2.0 * kPi) - 3.0 * std::log(kLegRadiusSigma_m); }

bool is_standing_leg(double radius_m) { return radius_m >= kMinStandingLeg_m && radius_m <= kMaxStandingLeg_m; }

/// True if it travelled, or at least has not stood for most of the time: a post has.
bool has_walked(const MapElement& element, std::int64_t stamp_ns) {
  const double age_s = seconds_between(element.first_seen_ns, stamp_ns);
  return element.mobile || (age_s > kMinAge_s && element.stood_s < kMaxStoodPart * age_s);
}

/// The log-odds that `other` is the other leg, after what one scan adds to them; without evidence none are kept.
double gather(MapElement& foot, std::uint64_t other, double change) {
  const double before = foot.other_leg == other ? foot.other_leg_log_odds : kPairAtFirst;
  const double after = std::min(before + change, kMaxPair);
  const bool none = after <= kPairAtFirst;
  foot.other_leg = none ? 0 : other;
  foot.other_leg_log_odds = none ? 0.0 : after;
  return none ? kPairAtFirst : after;
}

/// Two legs and what they were seen as before they parted, or 0.
using Legs = std::array<std::uint64_t, 3>;

bool is_of(const Legs& legs, std::uint64_t id) { return std::find(legs.begin(), legs.end(), id) != legs.end(); }

/// True if the elements are parts of other things than of each other.
bool are_parts_of_others(const MapElement& a, const MapElement& b, const Legs& legs) {
  return (a.is_part && !is_of(legs, a.body)) || (b.is_part && !is_of(legs, b.body));
}

/// What both legs were seen as before they parted: it was there until they came, is not seen any more, and was not
/// larger than both; or null.
MapElement* what_parted(const MapElement& a, const MapElement& b, const Eigen::Vector2d& middle_m,
                        std::int64_t stamp_ns, std::vector<MapElement>& elements) {
  const std::int64_t came_ns = std::min(a.first_seen_ns, b.first_seen_ns);
  const auto found = std::find_if(elements.begin(), elements.end(), [&](const MapElement& element) {
    if (is_person(element) || element.state != TrackState::kConfirmed || element.last_seen_ns >= came_ns) return false;
    if (unseen_s(element, stamp_ns) > kSamePast_s) return false;
    const Vector8d& x = likelier(element.estimate).x;
    const double radius_m = larger_radius_m(x);
    return radius_m <= kMaxBothLegs_m && (x.segment<2>(kPosition) - middle_m).norm() < radius_m + kBetween_m;
  });
  return found == elements.end() ? nullptr : &*found;
}

/// True if something larger than a leg is between two legs, such as a torso between its arms, or another person.
bool is_something_between(const Legs& legs, const Eigen::Vector2d& middle_m, std::int64_t stamp_ns,
                          const std::vector<MapElement>& elements) {
  return std::any_of(elements.begin(), elements.end(), [&](const MapElement& element) {
    if (is_of(legs, element.id)) return false;
    if (is_foot(element, stamp_ns) || is_out_of_sight(element, stamp_ns)) return false;
    if (element.state != TrackState::kConfirmed) return false;
    const Vector8d& x = likelier(element.estimate).x;
    return (x.segment<2>(kPosition) - middle_m).norm() < larger_radius_m(x) + kBetween_m;
  });
}

/// True if something confirmed that is larger than a leg, and no person, is there: `is_there` of the element, its
/// centre and the larger one of its radii.
template <class IsThere>
bool is_larger_there(const std::vector<MapElement>& elements, IsThere&& is_there) {
  return std::any_of(elements.begin(), elements.end(), [&](const MapElement& element) {
    if (is_person(element) || element.state != TrackState::kConfirmed) return false;
    const Vector8d& x = likelier(element.estimate).x;
    const double radius_m = larger_radius_m(x);
    return radius_m > kMaxLeg_m && is_there(element, Eigen::Vector2d(x.segment<2>(kPosition)), radius_m);
  });
}

/// True if something larger than a leg is beside one of two legs, such as the torso of which it is an arm.
bool is_beside_larger(const Legs& legs, const Eigen::Vector2d& center_m, std::int64_t stamp_ns,
                      const std::vector<MapElement>& elements) {
  return is_larger_there(elements, [&](const MapElement& element, const Eigen::Vector2d& there_m, double radius_m) {
    if (is_of(legs, element.id)) return false;
    return !is_out_of_sight(element, stamp_ns) && (there_m - center_m).norm() < radius_m + kBeside_m;
  });
}

/// True if something larger than a leg is where a person's legs are: a body, and what was taken for legs are its arms.
/// What came after the person is both legs in one, unless it is seen between them.
bool is_in_body(const MapElement& person, const SeenLegs& seen, std::int64_t stamp_ns,
                const std::vector<MapElement>& elements) {
  const Eigen::Vector2d middle_m = position(likelier(person.estimate));
  return is_larger_there(elements, [&](const MapElement& element, const Eigen::Vector2d& there_m, double /*radius_m*/) {
    return element.last_seen_ns == stamp_ns && (there_m - middle_m).norm() < kPersonRadius_m &&
           (seen.legs == 2 || element.first_seen_ns <= person.first_seen_ns);
  });
}

Eigen::Vector2d velocity(const MapElement& element) { return combine(element.estimate).x.segment<2>(kVelocity); }

}  // namespace

/// The element of a leg that a person lost, and has again: it was seen to walk, is new, or is already a part of the
/// person. A post is none of these.
void People::take_legs(std::int64_t stamp_ns, std::vector<MapElement>& elements) const {
  for (const std::size_t element : robbed_) {
    const bool is_new = seconds_between(elements[element].first_seen_ns, stamp_ns) < kSamePast_s;
    if (is_new || is_foot(elements[element], stamp_ns)) elements[element].state = TrackState::kDeleted;
  }
  for (const SeenLegs& seen : seen_) {
    const MapElement& person = elements[seen.element];
    if (seen.legs == 2 && person.estimate.p_moving < 0.5) continue;
    for (MapElement& element : elements) {
      if (!is_foot(element, stamp_ns)) continue;
      const bool is_new = element.first_seen_ns > person.first_seen_ns &&
                          seconds_between(element.first_seen_ns, stamp_ns) < kSamePast_s;
      const bool is_part = element.is_part && element.body == person.id;
      if (!element.mobile && !is_new && !is_part) continue;
      const Eigen::Vector2d apart_m = position(likelier(element.estimate)) - position(likelier(person.estimate));
      if (apart_m.norm() < kReach_m) element.state = TrackState::kDeleted;
    }
  }
}

/// True for what was seen as one thing, of the size of both legs, and now is one leg.
bool People::has_parted(const MapElement& element, int column, std::int64_t stamp_ns) const {
  if (column < 0 || element.state == TrackState::kDeleted || is_person(element)) return false;
  if (element.last_seen_ns != stamp_ns || element.observations < 2) return false;
  const Leg& leg = legs_[static_cast<std::size_t>(column)];
  const bool may_walk = element.mobile || element.estimate.p_moving > 0.5 || element.stood_s < kSamePast_s;
  return may_walk && leg.may_be_one && leg.has_shape && leg.is_ellipse && is_standing_leg(leg.measurement.z(2)) &&
         larger_radius_m(likelier(element.estimate).x) <= kMaxBothLegs_m;
}

void People::find_feet(std::int64_t stamp_ns, const std::vector<MapElement>& elements) {
  feet_.clear();
  for (std::size_t i = 0; i < elements.size(); ++i) {
    const ObjectEstimate& estimate = likelier(elements[i].estimate);
    const int column = i < std::min(first_row_, column_of_row_.size()) ? column_of_row_[i] : -1;
    if (is_foot(elements[i], stamp_ns)) {
      feet_.push_back({i, position(estimate), false, is_standing_leg(estimate.x(kShape))});
    } else if (has_parted(elements[i], column, stamp_ns)) {
      feet_.push_back({i, legs_[static_cast<std::size_t>(column)].center_world_m, true, true});
    }
  }
  std::sort(feet_.begin(), feet_.end(), [](const Foot& a, const Foot& b) {
    return std::make_pair(a.center_m.x(), a.element) < std::make_pair(b.center_m.x(), b.element);
  });
}

/// The nearest other one, or feet_.size(); and the distance to the second nearest.
std::size_t People::nearest_foot(std::size_t foot, double max_m, double& second_nearest_m) const {
  const Eigen::Vector2d& center_m = feet_[foot].center_m;
  std::size_t nearest = feet_.size();
  double nearest_m = max_m;
  second_nearest_m = std::numeric_limits<double>::infinity();
  const auto look_at = [&](std::size_t other) {
    const double distance_m = (feet_[other].center_m - center_m).norm();
    if (distance_m < nearest_m) {
      if (nearest != feet_.size()) second_nearest_m = std::min(second_nearest_m, nearest_m);
      nearest = other;
      nearest_m = distance_m;
    } else {
      second_nearest_m = std::min(second_nearest_m, distance_m);
    }
  };
  for (std::size_t i = foot; i-- > 0 && feet_[i].center_m.x() >= center_m.x() - max_m;) look_at(i);
  for (std::size_t i = foot + 1; i < feet_.size() && feet_[i].center_m.x() <= center_m.x() + max_m; ++i) look_at(i);
  return nearest;
}

void People::join_legs(std::int64_t stamp_ns, double step_s, const MotionParams& motion, double gate,
                       std::vector<MapElement>& elements) {
  // A person that is part of a body is none after all; the gait of the others tells that they are.
  for (const SeenLegs& seen : seen_) {
    MapElement& person = elements[seen.element];
    if (is_in_body(person, seen, stamp_ns, elements)) {
      person.state = TrackState::kDeleted;
      continue;
    }
    if (seen.legs < 2 || person.estimate.p_moving < 0.5 || velocity(person).norm() < kGaitSpeed_m_s) continue;
    person.p_class = class_probability(log_odds(person.p_class) + kClassGait_1_s * step_s);
  }
  take_legs(stamp_ns, elements);
  find_feet(stamp_ns, elements);
  for (std::size_t f = 0; f < feet_.size(); ++f) {
    MapElement& foot = elements[feet_[f].element];
    if (foot.state == TrackState::kDeleted || is_person(foot)) continue;
    if (is_leg_of_lost(foot, gate, stamp_ns, elements)) continue;
    double others_m = 0.0, others_of_other_m = 0.0;
    const std::size_t g = nearest_foot(f, kMaxApart_m, others_m);
    const bool mutual = g < feet_.size() && nearest_foot(g, kMaxApart_m, others_of_other_m) == f;
    if (!mutual) {
      step_about(feet_[f], stamp_ns, step_s, motion, gate, elements);
      continue;
    }
    MapElement& other = elements[feet_[g].element];
    if (other.state == TrackState::kDeleted || is_person(other) || other.id > foot.id) continue;  // once for each pair
    // `other` is the older one.
    const Eigen::Vector2d apart_m = feet_[f].center_m - feet_[g].center_m;
    const Eigen::Vector2d middle_m = 0.5 * (feet_[f].center_m + feet_[g].center_m);
    const double distance_m = apart_m.norm();
    const double speed = velocity(foot).norm();
    const double speed_of_other = velocity(other).norm();
    // A leg that passes a post is not one of two that stand.
    const bool same_past =
        !foot.mobile && !other.mobile && (other.stood_s - foot.stood_s < kSamePast_s || foot.stood_s > kSamePast_s);
    const bool leg_sized = feet_[f].is_leg_sized && feet_[g].is_leg_sized;
    const bool alone = std::min(others_m, others_of_other_m) > kAlone * distance_m;
    const bool stands = same_past && leg_sized && alone && distance_m >= kMinStanding_m && distance_m <= kMaxStanding_m;
    // Both are new, or one is and the other has come with it; and one of them moves.
    const auto is_new = [&](const MapElement& leg) {
      return seconds_between(leg.first_seen_ns, stamp_ns) < kSamePast_s;
    };
    MapElement* const whole = what_parted(foot, other, middle_m, stamp_ns, elements);
    const bool parts = whole != nullptr || feet_[g].has_parted;
    const bool comes = leg_sized && alone && distance_m <= kMaxStep_m && is_new(foot) &&
                       (is_new(other) || other.mobile) &&
                       (parts || std::max(foot.estimate.p_moving, other.estimate.p_moving) > kMoves);
    const bool walks = leg_sized && (foot.mobile || other.mobile) && has_walked(foot, stamp_ns) &&
                       has_walked(other, stamp_ns) && speed + speed_of_other > 2.0 * kGaitSpeed_m_s &&
                       velocity(foot).dot(velocity(other)) > -kGaitSpeed_m_s * kGaitSpeed_m_s;
    const double pair = gather(foot, other.id,
                               stands || comes ? kPairStanding
                               : walks         ? kPairGait_1_s * step_s
                                               : -kPairDecay_1_s * step_s);
    const bool tentative = foot.state == TrackState::kTentative && other.state == TrackState::kTentative;
    const Legs legs{foot.id, other.id, whole != nullptr ? whole->id : 0};
    if (pair < kClassStanding || (tentative && whole == nullptr) || are_parts_of_others(foot, other, legs)) continue;
    if (is_something_between(legs, middle_m, stamp_ns, elements)) continue;
    if (!stands && (distance_m < kMinStanding_m || is_beside_larger(legs, feet_[f].center_m, stamp_ns, elements))) {
      continue;
    }
    if (whole != nullptr) {  // goes on in place of one leg
      whole->last_seen_ns = stamp_ns;
      whole->beams = other.beams;
      whole->P_view = other.P_view;
      other.state = TrackState::kDeleted;
    }
    become_one_person(foot, whole != nullptr ? *whole : other, middle_m, 0.5 * apart_m, pair, motion, gate, stamp_ns,
                      elements);
  }
}

/// What is new, moves and may be one leg of a person who was lost is that: the other one may still be hidden.
bool People::is_leg_of_lost(MapElement& foot, double gate, std::int64_t stamp_ns, std::vector<MapElement>& elements) {
  const bool sets_off = foot.mobile || foot.estimate.p_moving > kMoves;
  const bool is_new = seconds_between(foot.first_seen_ns, stamp_ns) < kSamePast_s;
  if (!sets_off || !is_new || foot.state != TrackState::kConfirmed ||
      !is_standing_leg(likelier(foot.estimate).x(kShape)))
    return false;
  ObjectEstimate middle;
  middle.x.segment<2>(kPosition) = position(likelier(foot.estimate));
  middle.P.diagonal().segment<2>(kPosition).array() = kStride_m * kStride_m + kHips_m * kHips_m;
  MapElement* const person = who_may_be_at(middle, gate, stamp_ns, elements);
  if (person == nullptr) return false;
  come_back(foot, middle, *person, stamp_ns);
  person->leg_offset_variance_m2 = kStride_m * kStride_m;
  return true;
}

/// Something leg-sized that steps about a leg: a leg stands while the other swings, and neither stands for long. Where
/// scans are rare, no element follows a swinging leg, so the other one is what each scan shows.
void People::step_about(const Foot& leg, std::int64_t stamp_ns, double step_s, const MotionParams& motion, double gate,
                        std::vector<MapElement>& elements) {
  MapElement& foot = elements[leg.element];
  const Eigen::Vector2d& center_m = leg.center_m;
  std::size_t other = legs_.size();
  int others = 0;  // among several the nearest may change, and nothing steps
  for (std::size_t i = 0; i < legs_.size(); ++i) {
    const double distance_m = (legs_[i].center_world_m - center_m).norm();
    if (!legs_[i].may_be_one || distance_m > kMaxApart_m) continue;
    if (distance_m < kMinStanding_m) continue;  // that is the leg itself
    other = i;
    ++others;
  }
  const bool may_walk = foot.mobile || foot.stood_s < kSamePast_s;
  if (others != 1 || !may_walk || !leg.is_leg_sized || !is_free(other, stamp_ns, elements)) {
    gather(foot, foot.id, -kPairDecay_1_s * step_s);
    return;
  }
  const Eigen::Vector2d offset_m = 0.5 * (center_m - legs_[other].center_world_m);
  const bool knows = foot.other_leg == foot.id;
  const double step_m = knows ? 2.0 * (offset_m - foot.leg_offset_world_m).norm() : 0.0;
  if (!knows || step_m > kMinStep_m) foot.leg_offset_world_m = offset_m;
  const double change = !knows                ? kPairAtFirst * -0.1
                        : step_m > kMinStep_m ? kPairStep_1_m * std::min(step_m, kMaxStep_m)
                        : leg.has_parted      ? kPairStanding
                                              : -kPairDecay_1_s * step_s;
  const double log_odds = gather(foot, foot.id, change);
  if (log_odds < kClassStanding || foot.state != TrackState::kConfirmed || (foot.is_part && foot.body != foot.id))
    return;
  const bool is_element = row_of_column_[other] >= 0;
  MapElement& other_leg = is_element ? elements[static_cast<std::size_t>(row_of_column_[other])] : foot;
  if (is_beside_larger({foot.id, other_leg.id, 0}, center_m, stamp_ns, elements)) return;
  if (is_element) {
    become_one_person(foot, other_leg, center_m - offset_m, offset_m, log_odds, motion, gate, stamp_ns, elements);
  } else {
    become_person(foot, center_m - offset_m, offset_m, log_odds, motion, gate, stamp_ns, elements);
  }
}

/// Two elements become a person, who keeps the id of the one that is on the map, or else of the older one.
void People::become_one_person(MapElement& a, MapElement& b, const Eigen::Vector2d& middle_m,
                               const Eigen::Vector2d& offset_m, double pair_log_odds, const MotionParams& motion,
                               double gate, std::int64_t stamp_ns, std::vector<MapElement>& elements) {
  const bool a_on_map = a.state != TrackState::kTentative, b_on_map = b.state != TrackState::kTentative;
  const bool keep_a = a_on_map != b_on_map ? a_on_map : a.id < b.id;
  MapElement& kept = keep_a ? a : b;
  MapElement& dropped = keep_a ? b : a;
  dropped.state = TrackState::kDeleted;
  kept.log_odds = std::max(kept.log_odds, dropped.log_odds);
  kept.beams += dropped.beams;
  kept.mobile = kept.mobile && dropped.mobile;
  become_person(kept, middle_m, offset_m, pair_log_odds, motion, gate, stamp_ns, elements);
}

/// The person who is not seen, but may be at `middle_world`; or none.
MapElement* People::who_may_be_at(const ObjectEstimate& middle_world, double gate, std::int64_t stamp_ns,
                                  std::vector<MapElement>& elements) {
  const Measurement here = middle_at(position(middle_world), middle_world.P.topLeftCorner<2, 2>(), 0.0);
  MapElement* likeliest = nullptr;
  double most = kLogNewObjectDensity;
  for (MapElement& person : elements) {
    if (!is_person(person) || person.state == TrackState::kDeleted || person.last_seen_ns == stamp_ns) continue;
    const Match match = situation_awareness::match(combine(person.estimate), {}, here, Eigen::Matrix3d::Zero());
    const double log_likelihood = match.log_likelihood - log_likelihood_of_shape();
    if (!inside_gate(match, gate) || !(log_likelihood > most)) continue;
    most = log_likelihood;
    likeliest = &person;
  }
  return likeliest;
}

/// The element becomes a person with this middle: that one who is not seen and may be here, or a new one.
void People::become_person(MapElement& foot, const Eigen::Vector2d& middle_m, const Eigen::Vector2d& offset_m,
                           double pair_log_odds, const MotionParams& motion, double gate, std::int64_t stamp_ns,
                           std::vector<MapElement>& elements) {
  ObjectEstimate mapped;
  mapped.x.segment<2>(kPosition) = middle_m;
  mapped.x(kShape) = kPersonRadius_m;
  mapped.P.diagonal().segment<2>(kPosition).array() = kHips_m * kHips_m;
  mapped.P(kShape, kShape) = kPersonRadiusSigma_m * kPersonRadiusSigma_m;
  if (MapElement* const person = who_may_be_at(mapped, gate, stamp_ns, elements)) {
    come_back(foot, mapped, *person, stamp_ns);
    person->leg_offset_world_m = offset_m;
    person->leg_offset_variance_m2 = kHips_m * kHips_m;
    return;
  }
  foot.p_class = class_probability(pair_log_odds);
  foot.object_class = ObjectClass::kPerson;
  foot.box_log_odds = kSurelyEllipse;
  foot.estimate = start(mapped, motion_of_person(motion));
  if (foot.mobile) foot.estimate.p_moving = kMoves;
  foot.state = TrackState::kConfirmed;
  foot.is_part = false;
  foot.body = 0;
  foot.other_leg = 0;
  foot.other_leg_log_odds = 0.0;
  foot.leg_offset_world_m = offset_m;
  foot.leg_offset_variance_m2 = kHips_m * kHips_m;
}

/// A person who was not seen is seen again, by this element; the velocity is what led there.
void People::come_back(MapElement& foot, const ObjectEstimate& middle_world, MapElement& person,
                       std::int64_t stamp_ns) {
  const Measurement here = middle_at(position(middle_world), middle_world.P.topLeftCorner<2, 2>(), 0.0);
  const Eigen::Matrix3d U = Eigen::Matrix3d::Zero();
  const MotionMatch match = situation_awareness::match(person.estimate, {}, here, U);
  situation_awareness::update(person.estimate, {}, here, match, U);
  foot.state = TrackState::kDeleted;
  person.state = TrackState::kConfirmed;
  person.log_odds = std::max(person.log_odds, foot.log_odds);
  person.last_seen_ns = stamp_ns;
  person.beams = foot.beams;
  person.P_view = foot.P_view;
  count_more(person.observations, foot.observations);
}

}  // namespace situation_awareness

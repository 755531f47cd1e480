// SPDX-License-Identifier: BSD-3-Clause
#include "situation_awareness/path/safety_areas.hpp"

#include <algorithm>
#include <cmath>
#include <stdexcept>
#include <utility>

#include <Eigen/Geometry>

#include "situation_awareness/common/time.hpp"
#include "situation_awareness/estimation/covariance.hpp"
#include "situation_awareness/geometry/angles.hpp"
#include "situation_awareness/geometry/simplify.hpp"

namespace situation_awareness {
namespace {

// Where no source is named, none is recorded; the sensitivity of these was not measured.

/// s. The same of the measured speed: without it the vehicle counts as driving at its greatest one.
constexpr double kMaxSpeedAge_s = 0.5;

using DecidedVerdict = SafetyDecision::Verdict;
using DecidedKind = SafetyDecision::Kind;
constexpr double kRimSpacing_m = 0.05;  // of places on the outline of the footprint, for the polygons
// The error against the path gets smaller by this factor e on the way; the controller's is 1 / K3, 0.67 m.
constexpr double kSettling_m = 0.7;
constexpr double kMostHeading_rad = 1.2;     // beyond this the way that the vehicle will take is not the path
constexpr double kFlip_rad = 1.65;           // an open path is driven the other way round beyond this
constexpr double kStopTolerance_m_s = 0.05;  // so that noise of a vehicle at its allowed speed does not stop it
constexpr double kStanding_m_s = 0.02;       // slower is to stand
constexpr double kSeenTolerance_m = 0.05;
constexpr double kRememberSpacing_m = 0.1;
constexpr std::size_t kMostRemembered = 64;
constexpr double kTravel_m = 0.2;  // after which the pose should have moved, by this part
constexpr double kLeastMoved = 0.25;
constexpr double kMoves_m = 0.001;  // a pose that stood still moves again
constexpr double kMostPeriod_s = 0.2;
constexpr double kNearer_m = 0.01;  // than now, from which on an unseen chain counts

/// The greatest speed with which the vehicle stops in a way.
double stopping_speed_m_s(double way_m, double reaction_s, double deceleration_m_s2) {
  if (way_m <= 0.0) return 0.0;
  const double lost_m_s = reaction_s * deceleration_m_s2;
  return std::sqrt(lost_m_s * lost_m_s + 2.0 * deceleration_m_s2 * way_m) - lost_m_s;
}

/// A scanner that is covered or out of order says nothing of most directions, where one in order loses single beams.
bool is_blind(const Points& points) {
  const auto invalid = std::count_if(points.points.begin(), points.points.end(),
                                     [](const Point& point) { return point.state == BeamState::kInvalid; });
  return 2 * invalid >= static_cast<std::ptrdiff_t>(points.points.size());
}

double stopping_way_m(double speed_m_s, double reaction_s, double deceleration_m_s2) {
  return speed_m_s * (reaction_s + 0.5 * speed_m_s / deceleration_m_s2);
}

}  // namespace

const char* name_of(SafetyPolicy policy) {
  switch (policy) {
    case SafetyPolicy::kConservative:
      return "conservative";
    case SafetyPolicy::kUpdated:
      return "updated";
    case SafetyPolicy::kIgnoreKnown:
      return "ignore_known";
  }
  return "";
}

std::string yaml_text(SafetyPolicy policy) { return name_of(policy); }

void read_yaml_text(const std::string& yaml, SafetyPolicy& policy) {
  for (const auto known : {SafetyPolicy::kConservative, SafetyPolicy::kUpdated, SafetyPolicy::kIgnoreKnown}) {
    if (yaml != name_of(known) && yaml != '"' + std::string(name_of(known)) + '"') continue;
    policy = known;
    return;
  }
  throw std::invalid_argument("must be conservative, updated or ignore_known");
}

const char* name_of(DecidedVerdict verdict) {
  switch (verdict) {
    case DecidedVerdict::kFullSpeed:
      return "full speed";
    case DecidedVerdict::kSlow:
      return "slow";
    case DecidedVerdict::kStop:
      return "stop";
  }
  return "";
}

const char* name_of(DecidedKind kind) {
  switch (kind) {
    case DecidedKind::kNone:
      return "none";
    case DecidedKind::kUnknownHit:
      return "unknown hit";
    case DecidedKind::kChain:
      return "chain";
    case DecidedKind::kObject:
      return "object";
    case DecidedKind::kHidden:
      return "hidden";
    case DecidedKind::kPose:
      return "pose";
    case DecidedKind::kContradiction:
      return "contradiction";
    case DecidedKind::kFrozenScan:
      return "frozen scan";
  }
  return "";
}

bool has_place(DecidedKind kind) {
  return kind == DecidedKind::kUnknownHit || kind == DecidedKind::kChain || kind == DecidedKind::kObject ||
         kind == DecidedKind::kHidden;
}

const char* name_of(SafetyInput input) {
  switch (input) {
    case SafetyInput::kMap:
      return "map";
    case SafetyInput::kCovariance:
      return "covariance of the pose";
    case SafetyInput::kSpeed:
      return "speed";
  }
  return "";
}

void SafetyParams::validate() const {
  check_bounds(*this, "safety");
  if (floor_margin_m > margin_m) {
    throw std::invalid_argument("safety.floor_margin_m must not be greater than safety.margin_m");
  }
}

SafetyAreas::SafetyAreas(const Path& path, const VehicleParams& vehicle, const SafetyParams& params,
                         const std::string& source)
    : vehicle_((vehicle.validate(), vehicle)),
      params_((params.validate(), params)),
      reach_m_(reach_m(vehicle_.footprint)),
      ground_(reach_m_ + params_.floor_margin_m) {
  ways_.emplace_back(path, source);
  if (!path.closed) ways_.emplace_back(reversed(path), source);
  const auto& corners = vehicle_.footprint.corners_m;
  for (std::size_t i = 0; i < corners.size(); ++i) {
    const Eigen::Vector2d edge = corners[(i + 1) % corners.size()] - corners[i];
    const int pieces = std::max(1, static_cast<int>(std::ceil(edge.norm() / kRimSpacing_m)));
    for (int k = 0; k < pieces; ++k) rim_m_.emplace_back(corners[i] + edge * (static_cast<double>(k) / pieces));
  }
  full_speed_m_s_ = vehicle_.max_speed_m_s;
  const double most_m = way_of_speed_m(full_speed_m_s_) +
                        4.0 * (reach_m_ + warning_margin_m(full_speed_m_s_) + params_.sigmas * params_.max_sigma_m);
  const auto frames = static_cast<std::size_t>(most_m / kStep_m) + 8;
  steps_.reserve(frames);
  frames_.reserve(frames);
  for (auto* widths : {&left_m_, &right_m_, &wide_left_m_, &wide_right_m_, &floor_left_m_, &floor_right_m_}) {
    widths->reserve(frames);
  }
  decision_.warning_world_m.reserve(2 * frames);
  decision_.protective_world_m.reserve(2 * frames);
  remembered_.reserve(kMostRemembered);
  seen_through_.reserve(kMostPasses);
  decision_.missing.reserve(4);
}

void SafetyAreas::reset() {
  remembered_.clear();
  ground_.clear();
  on_path_ = false;
  travel_m_ = 0.0;
  travel_ns_ = 0;
}

// --- what may be used

bool SafetyAreas::is_fresh(std::int64_t stamp_ns, double max_age_s) const {
  return stamp_ns > 0 && std::abs(seconds_between(stamp_ns, decision_.stamp_ns)) <= max_age_s;
}

bool SafetyAreas::is_fresh(const Map& map) const {
  return is_fresh(map.stamp_ns, params_.max_map_age_s) && is_fresh(map.objects_stamp_ns, params_.max_map_age_s);
}

/// What is not measured may be as fast as the vehicle can.
double SafetyAreas::known_speed_m_s(const VehicleState& vehicle) {
  const bool is_known = std::isfinite(vehicle.speed_m_s) &&
                        (!vehicle.speed_stamp_ns || is_fresh(*vehicle.speed_stamp_ns, kMaxSpeedAge_s));
  if (is_known) return std::abs(vehicle.speed_m_s);
  decision_.missing.push_back(SafetyInput::kSpeed);
  return vehicle_.max_speed_m_s;
}

/// While the speed says that the vehicle moves: a source of poses that repeats itself.
bool SafetyAreas::pose_stands_still(const VehicleState& vehicle, bool speed_is_known) {
  const double period_s = std::clamp(seconds_between(travel_ns_, decision_.stamp_ns), 0.0, kMostPeriod_s);
  const Eigen::Vector2d& p_world_m = vehicle.T_world_base.translation_m;
  const double moved_m = (p_world_m - travel_from_m_).norm();
  const bool is_first = travel_ns_ == 0;
  travel_ns_ = decision_.stamp_ns;
  const double speed_m_s = std::abs(vehicle.speed_m_s);
  if (speed_is_known && speed_m_s >= kStanding_m_s) travel_m_ += speed_m_s * period_s;
  const bool moves = moved_m >= (stands_still_ ? kMoves_m : kLeastMoved * kTravel_m);
  if (!is_first && !moves) {
    stands_still_ = stands_still_ || travel_m_ >= kTravel_m;
    return stands_still_;
  }
  stands_still_ = false;
  travel_m_ = 0.0;
  travel_from_m_ = p_world_m;
  return false;
}

/// False where the pose is not known well enough.
bool SafetyAreas::take_covariance(const Eigen::Matrix3d& covariance_world) {
  if (!is_positive_semidefinite(covariance_world)) {
    decision_.missing.push_back(SafetyInput::kCovariance);
    return false;
  }
  const Eigen::Matrix2d P = covariance_world.topLeftCorner<2, 2>();
  const double variance_m2 = 0.5 * (P.trace() + std::hypot(P(0, 0) - P(1, 1), 2.0 * P(0, 1)));  // the greatest
  sigma_m_ = std::sqrt(std::max(variance_m2, 0.0));
  sigma_rad_ = std::sqrt(std::max(covariance_world(2, 2), 0.0));
  margins_.floor_m = params_.floor_margin_m + params_.sigmas * sigma_m_;
  margins_.protective_m = params_.margin_m + params_.sigmas * sigma_m_;
  return sigma_m_ <= params_.max_sigma_m && sigma_rad_ <= params_.max_sigma_rad;
}

// --- speeds, ways and margins: each grows with the others

double SafetyAreas::way_of_speed_m(double speed_m_s) const {
  return params_.standoff_m + stopping_way_m(speed_m_s, vehicle_.reaction_s, vehicle_.slowing_m_s2);
}

double SafetyAreas::speed_of_way_m_s(double way_m) const {
  return stopping_speed_m_s(way_m - params_.standoff_m, vehicle_.reaction_s, vehicle_.slowing_m_s2);
}

double SafetyAreas::floor_speed_of_way_m_s(double way_m) const {
  return stopping_speed_m_s(way_m, vehicle_.reaction_s, vehicle_.braking_m_s2);
}

/// Beyond the protective one: what a mover comes nearer while the vehicle stops.
double SafetyAreas::warning_margin_m(double speed_m_s) const {
  return params_.mover_speed_m_s * (vehicle_.reaction_s + speed_m_s / vehicle_.braking_m_s2);
}

double SafetyAreas::speed_of_margin_m_s(double margin_m) const {
  const double time_s = std::max(margin_m, 0.0) / params_.mover_speed_m_s - vehicle_.reaction_s;
  return std::max(time_s, 0.0) * vehicle_.braking_m_s2;
}

// --- the way

bool SafetyAreas::place_on_path(const VehicleState& vehicle) {
  const Eigen::Vector2d& p_world_m = vehicle.T_world_base.translation_m;
  const auto is_far = [&] { return (ways_[direction_].at(way_m_).p_world_m - p_world_m).norm() > params_.max_error_m; };
  if (on_path_) way_m_ = ways_[direction_].nearest_m(p_world_m, way_m_);
  if (!on_path_ || is_far()) way_m_ = ways_[direction_].nearest_m(p_world_m);
  on_path_ = !is_far();
  if (!on_path_) return false;
  const auto heading_rad = [&] {
    return std::abs(wrap_to_pi(vehicle.T_world_base.yaw_rad - ways_[direction_].at(way_m_).yaw_rad));
  };
  if (heading_rad() > kFlip_rad && ways_.size() > 1) {
    direction_ = 1 - direction_;
    way_m_ = ways_[direction_].nearest_m(p_world_m, ways_[direction_].length_m() - way_m_);
  }
  return heading_rad() <= kMostHeading_rad;
}

void SafetyAreas::set_full_speed() {
  const SplinePath& way = ways_[direction_];
  const std::size_t segment = way.at(way_m_).segment;
  full_speed_m_s_ = std::min(vehicle_.max_speed_m_s, way.speed_m_s(segment).value_or(kNoLimit));
  decision_.segment = direction_ == 0 ? segment : way.segments() - 1 - segment;
}

/// Poses of the vehicle on the way on which it stops from its full speed, on an open path up to its end.
void SafetyAreas::make_way(const VehicleState& vehicle) {
  const SplinePath& way = ways_[direction_];
  const Pose2 error = inverse(way.at(way_m_).pose()) * vehicle.T_world_base;
  const double most_m = way_of_speed_m(full_speed_m_s_) + kStep_m;
  const double left_m = way.closed() ? kNoLimit : std::max(way.length_m() - way_m_, 0.0);
  steps_.clear();
  for (int k = 0; k * kStep_m <= std::min(most_m, left_m + kStep_m); ++k) {
    const double d_m = std::min(k * kStep_m, left_m);
    const double part = std::exp(-d_m / kSettling_m);
    const Pose2 pose =
        way.at(way_m_ + d_m).pose() * Pose2{part * error.translation_m, part * wrap_to_pi(error.yaw_rad)};
    steps_.emplace_back(k == 0 ? vehicle.T_world_base : pose);
  }
  low_m_ = high_m_ = T_world_base_.translation_m;
  for (const Step& step : steps_) {
    low_m_ = low_m_.cwiseMin(step.pose.translation_m);
    high_m_ = high_m_.cwiseMax(step.pose.translation_m);
  }
  const double beside_m = reach_m_ + margins_.protective_m + warning_margin_m(full_speed_m_s_);
  low_m_.array() -= beside_m;
  high_m_.array() += beside_m;
}

bool SafetyAreas::is_near(const Eigen::Vector2d& p_world_m, double more_m) const {
  return ((p_world_m - low_m_).array() >= -more_m).all() && ((high_m_ - p_world_m).array() >= -more_m).all();
}

// --- the verdict

SafetyAreas::Limits SafetyAreas::limits_of(const Thing& thing) const {
  Weight weight = thing.weight;
  if (weight == Weight::kKnown && decision_.policy == SafetyPolicy::kConservative) weight = Weight::kStands;
  const bool warns = weight == Weight::kMayMove || weight == Weight::kStands;
  const bool is_shrunk = weight == Weight::kKnown && decision_.policy == SafetyPolicy::kUpdated;
  double margin_m = warns ? margins_.protective_m : margins_.floor_m;
  if (weight == Weight::kUnseen) {
    // Where the vehicle is nothing else can be.
    const double now_m = clearance_m(vehicle_.footprint, steps_.front().to_base(thing.p_world_m));
    if (now_m <= kNearer_m) return {kNoLimit, kNoLimit, kNoLimit};
    margin_m = std::min(margin_m, now_m - kNearer_m);
  }

  double contact_m = kNoLimit, before_m = kNoLimit;
  double warning_m_s = kNoLimit, nearest_m = kNoLimit, nearest_at_m = 0.0;
  for (std::size_t k = 0; k < steps_.size(); ++k) {
    const double d_m = static_cast<double>(k) * kStep_m;
    const double earlier_m = k > 0 ? d_m - kStep_m : 0.0;
    if (speed_of_way_m_s(earlier_m) > full_speed_m_s_ && k > 0) break;
    const Eigen::Vector2d p_base_m = steps_[k].to_base(thing.p_world_m);
    const double c_m = clearance_m(vehicle_.footprint, p_base_m);
    if (c_m <= margin_m && contact_m == kNoLimit) {
      const double part = before_m < kNoLimit ? (before_m - margin_m) / std::max(before_m - c_m, 1e-9) : 1.0;
      contact_m = earlier_m + part * (d_m - earlier_m);
    }
    before_m = c_m;
    if (!warns) continue;
    warning_m_s = std::min(warning_m_s, std::max(k > 0 ? speed_of_way_m_s(earlier_m) : 0.0,
                                                 speed_of_margin_m_s(c_m - margins_.protective_m)));
    if (c_m < nearest_m) {
      nearest_m = c_m;
      nearest_at_m = d_m;
    }
  }
  Limits limits{kNoLimit, kNoLimit, contact_m < kNoLimit ? contact_m : nearest_at_m};
  if (contact_m < kNoLimit) {
    limits.stop_m_s = warns || is_shrunk ? speed_of_way_m_s(contact_m) : floor_speed_of_way_m_s(contact_m);
  }
  limits.speed_m_s = limits.stop_m_s;
  if (weight == Weight::kStands) warning_m_s = std::max(warning_m_s, params_.slow_speed_m_s);
  if (warns) limits.speed_m_s = std::min(limits.speed_m_s, warning_m_s);
  return limits;
}

void SafetyAreas::judge(double present_m_s) {
  const Thing* slowest = nullptr;
  const Thing* stopping = nullptr;
  Limits least{kNoLimit, full_speed_m_s_, kNoLimit}, least_stop{kNoLimit, 0.0, kNoLimit};
  const std::size_t remembered = remembered_.size();
  for (const Thing& thing : things_) {
    const Limits limits = limits_of(thing);
    if (!(limits.speed_m_s < full_speed_m_s_)) {
      if (thing.weight == Weight::kKnown && decision_.policy != SafetyPolicy::kConservative) ++decision_.ignored;
      continue;
    }
    ++decision_.counted;
    if (thing.weight == Weight::kMayMove && thing.point >= 0 && remembered_.size() < kMostRemembered) {
      const bool is_new = std::none_of(
          remembered_.begin() + static_cast<std::ptrdiff_t>(remembered), remembered_.end(),
          [&](const Remembered& place) { return (place.p_world_m - thing.p_world_m).norm() < kRememberSpacing_m; });
      if (is_new) remembered_.push_back({thing.p_world_m, decision_.stamp_ns});
    }
    if (limits.speed_m_s < least.speed_m_s) {
      least = limits;
      slowest = &thing;
    }
    if (limits.stop_m_s < least_stop.stop_m_s) {
      least_stop = limits;
      stopping = &thing;
    }
  }
  const auto name = [this](const Thing& thing, const Limits& limits) {
    decision_.kind = thing.kind;
    decision_.id = thing.id;
    decision_.place_world_m = thing.p_world_m;
    decision_.distance_m = limits.distance_m;
  };
  decision_.verdict = DecidedVerdict::kFullSpeed;
  decision_.kind = DecidedKind::kNone;
  decision_.allowed_speed_m_s = full_speed_m_s_;
  if (slowest != nullptr) {
    decision_.verdict = DecidedVerdict::kSlow;
    decision_.allowed_speed_m_s = least.speed_m_s;
    name(*slowest, least);
  }
  if (stopping != nullptr && present_m_s > least_stop.stop_m_s + kStopTolerance_m_s) {
    decision_.verdict = DecidedVerdict::kStop;
    name(*stopping, least_stop);
  }
}

/// A part of the way that the scan does not see ends it: within sight the vehicle can stop.
void SafetyAreas::look_along_the_way(const Points& points) {
  double front_m = 0.0, left_m = 0.0, right_m = 0.0;
  for (const Eigen::Vector2d& corner : vehicle_.footprint.corners_m) {
    front_m = std::max(front_m, corner.x());
    left_m = std::max(left_m, corner.y());
    right_m = std::min(right_m, corner.y());
  }
  const Pose2 T_level_world = inverse(points.T_world_level);
  for (std::size_t k = 1; k < steps_.size(); ++k) {
    for (const double across_m : {right_m, 0.0, left_m}) {
      const Eigen::Vector2d p_world_m = steps_[k].to_world({front_m, across_m});
      const Eigen::Vector2d p_level_m = T_level_world * p_world_m;
      if (seen_range_m(points, p_level_m) + kSeenTolerance_m >= p_level_m.norm()) continue;
      const double seen_m = static_cast<double>(k - 1) * kStep_m;
      const double speed_m_s = floor_speed_of_way_m_s(seen_m);
      if (speed_m_s >= decision_.allowed_speed_m_s) return;
      decision_.allowed_speed_m_s = speed_m_s;
      if (decision_.verdict == DecidedVerdict::kStop) return;
      decision_.verdict = DecidedVerdict::kSlow;
      decision_.kind = DecidedKind::kHidden;
      decision_.id = 0;
      decision_.place_world_m = p_world_m;
      decision_.distance_m = seen_m;
      return;
    }
  }
}

/// Of the circle about the base that the footprint sweeps when it turns, what this scan sees to be free.
void SafetyAreas::note_what_is_free(const Points& points) {
  const Pose2 T_level_world = inverse(points.T_world_level), T_base_world = inverse(T_world_base_);
  ground_.see(T_world_base_.translation_m, points.stamp_ns, [&](const Eigen::Vector2d& p_world_m) {
    if (clearance_m(vehicle_.footprint, T_base_world * p_world_m) == 0.0) return true;  // the vehicle itself is there
    const Eigen::Vector2d p_level_m = T_level_world * p_world_m;
    return seen_range_m(points, p_level_m) >= p_level_m.norm();
  });
}

/// Nothing that counts is in that circle, nothing on the maps, seen or not, and all of it was seen free.
bool SafetyAreas::may_turn() {
  const Eigen::Vector2d& middle_m = T_world_base_.translation_m;
  const double circle_m = reach_m_ + margins_.floor_m;
  const bool hits_something = std::any_of(things_.begin(), things_.end(), [&](const Thing& thing) {
    const bool may_move = thing.weight == Weight::kMayMove;
    const double most_m = may_move ? reach_m_ + margins_.protective_m + warning_margin_m(0.0) : circle_m;
    return (thing.p_world_m - middle_m).norm() <= most_m;
  });
  const bool is_on_map =
      std::any_of(
          edges_.begin(), edges_.end(),
          [&](const Edge& edge) { return distance_from_segment_m(middle_m, edge.from_m, edge.to_m) <= circle_m; }) ||
      std::any_of(movers_.begin(), movers_.end(), [&](const Mover& mover) {
        return (mover.ellipse.center_m - middle_m).norm() - std::max(mover.ellipse.rx_m, mover.ellipse.ry_m) <=
               circle_m;
      });
  if (hits_something || is_on_map) return false;
  const Pose2 T_base_world = inverse(T_world_base_);
  const std::int64_t since_ns = decision_.stamp_ns - nanoseconds(params_.turn_memory_s);
  return ground_.was_seen(middle_m, since_ns, decision_.stamp_ns, [&](const Eigen::Vector2d& p_world_m) {
    return clearance_m(vehicle_.footprint, T_base_world * p_world_m) <= ground_.cell_m();
  });
}

const SafetyDecision& SafetyAreas::update(const Points& points, const VehicleState& vehicle, const Map& map,
                                          const std::vector<float>& ranges_m) {
  decision_.stamp_ns = points.stamp_ns;
  decision_.policy = params_.policy;
  decision_.verdict = DecidedVerdict::kStop;
  decision_.kind = DecidedKind::kPose;
  decision_.id = 0;
  decision_.place_world_m.setZero();
  decision_.distance_m = kNoLimit;
  decision_.allowed_speed_m_s = 0.0;
  decision_.may_turn = false;
  decision_.missing.clear();
  decision_.counted = decision_.ignored = 0;
  decision_.warning_world_m.clear();
  decision_.protective_world_m.clear();

  if (!is_fresh(map)) {
    decision_.missing.push_back(SafetyInput::kMap);
    decision_.policy = SafetyPolicy::kConservative;
  }
  const double present_m_s = known_speed_m_s(vehicle);
  const bool is_known_well = take_covariance(vehicle.covariance_world);
  const bool is_finite = vehicle.T_world_base.translation_m.allFinite() && std::isfinite(vehicle.T_world_base.yaw_rad);
  if (!is_finite) return decision_;
  const bool speed_is_known = std::count(decision_.missing.begin(), decision_.missing.end(), SafetyInput::kSpeed) == 0;
  const bool pose_is_frozen = pose_stands_still(vehicle, speed_is_known);
  const bool is_frozen = repeated_.add(ranges_m, points);
  if (!is_known_well || pose_is_frozen) return decision_;
  T_world_base_ = vehicle.T_world_base;
  find_outlines(map);
  view_chains(points, map);
  const bool contradicts = blind_.add(points, view_, T_world_base_.yaw_rad);
  const bool is_blind_scanner = contradicts || (params_.must_see_ahead && !blind_.has_seen_ahead());
  const bool heads_along = place_on_path(vehicle);
  if (is_frozen || is_blind_scanner) {
    decision_.kind = is_frozen          ? DecidedKind::kFrozenScan
                     : is_blind(points) ? DecidedKind::kHidden
                                        : DecidedKind::kContradiction;
    return decision_;
  }
  note_what_is_free(points);
  if (!on_path_) return decision_;
  set_full_speed();
  make_way(vehicle);
  things_.clear();
  gather_edges(map);
  gather_movers(map);
  gather_things(points);
  count_neighbours();
  recall(points);
  gather_unseen_chains(points);
  decision_.may_turn = !is_blind(points) && may_turn();
  if (!heads_along) return decision_;

  judge(present_m_s);
  look_along_the_way(points);
  if (decision_.allowed_speed_m_s < kStanding_m_s) decision_.verdict = DecidedVerdict::kStop;
  if (decision_.verdict == DecidedVerdict::kStop) decision_.allowed_speed_m_s = 0.0;

  make_frames();
  sweep(way_of_speed_m(full_speed_m_s_), margins_.protective_m + warning_margin_m(full_speed_m_s_),
        decision_.warning_world_m);
  sweep(way_of_speed_m(std::min(present_m_s, full_speed_m_s_)), margins_.protective_m, decision_.protective_world_m);
  return decision_;
}

}  // namespace situation_awareness

// SPDX-License-Identifier: BSD-3-Clause
#include "situation_awareness/path/circumnavigation.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdio>
#include <limits>
#include <stdexcept>
#include <utility>
#include <variant>

#include <yaml-cpp/yaml.h>
#include <Eigen/Eigenvalues>

#include "situation_awareness/common/stamp_order.hpp"
#include "situation_awareness/common/time.hpp"
#include "situation_awareness/geometry/angles.hpp"
#include "situation_awareness/geometry/vectors.hpp"
#include "situation_awareness/path/large_obstacles.hpp"

namespace situation_awareness {
namespace {

// Where no source is named, none is recorded; the sensitivity of these was not measured.

/// s. Longest time between plans.
constexpr double kReplan_s = 1.0;
/// m. Distance of the places of which it is remembered what was seen from there.
constexpr double kSightSpacing_m = 2.0;
/// Number of the places of which it is remembered what was seen from there.
constexpr int kSights = 100;

/// m. Of an orbit, for which a longer way is allowed to begin with: approaching it.
constexpr double kShortOrbit_m = 100.0;
/// s. A boundary that has just been closed may open again: its ends hardly overlap.
constexpr double kSettled_s = 3.0;
/// Of the outline of a boundary that was done: from here on more of it has appeared.
constexpr double kMoreOutline = 1.2;
/// m. What is no farther from another boundary, or than the standard deviations of both are, is along that; so much of
/// the vertices, at least, of what is the same obstacle.
constexpr double kSameOutline_m = 0.5, kMostOfOutline = 0.8;
/// Scans in a row, with hits, that say exactly the same while the vehicle moves are one that is repeated.
constexpr int kSameScans = 3;
/// Of the beams that cross what is mapped, and of these at least: if more go on behind it by so much (m), the scan or
/// the map is wrong. Of all beams so many are looked at.
constexpr double kPassing = 0.5, kBehind_m = 2.0;
constexpr int kFewestCrossing = 5;
constexpr std::size_t kLookedAt = 180;
/// s. So much ahead of the pose nothing is from now.
constexpr double kMostAhead_s = 0.5;
/// Of the radius of turns: farther beside its path the vehicle does not follow it.
constexpr double kOffPath = 0.5;

/// Const as the items are.
template <class Items>
auto* with_id(Items& items, std::uint64_t id) {
  const auto found = std::find_if(items.begin(), items.end(), [id](const auto& item) { return item.id == id; });
  return found == items.end() ? nullptr : &*found;
}

double greatest_sigma_m(const Splinegon& boundary) {
  double sigma_m = 0.0;
  for (const SplinegonVertex& vertex : boundary.vertices) sigma_m = std::max(sigma_m, vertex.sigma_m);
  return sigma_m;
}

double chord_length_m(const Splinegon& boundary) {
  double sum_m = 0.0;
  for (std::size_t i = boundary.closed ? 0 : 1; i < boundary.vertices.size(); ++i) {
    const std::size_t before = i == 0 ? boundary.vertices.size() - 1 : i - 1;
    sum_m += (boundary.vertices[i].p_world_m - boundary.vertices[before].p_world_m).norm();
  }
  return sum_m;
}

Eigen::Vector2d middle_of(const Splinegon& boundary) {
  Eigen::Vector2d sum_m = Eigen::Vector2d::Zero();
  for (const SplinegonVertex& vertex : boundary.vertices) sum_m += vertex.p_world_m;
  return sum_m / static_cast<double>(boundary.vertices.size());
}

void check_at_least(const char* name, double value, const char* bound_name, double bound) {
  if (value >= bound) return;
  throw std::invalid_argument("circumnavigation." + std::string(name) + " = " + std::to_string(value) + " is below " +
                              bound_name + " = " + std::to_string(bound));
}

}  // namespace

std::string yaml_text(const SearchPlaces& search) {
  std::string list;
  for (const DubinsEnd& place : search.places) {
    list += (list.empty() ? "[" : ", [") + yaml_text(place.p_m.x()) + ", " + yaml_text(place.p_m.y());
    if (place.yaw_rad) list += ", " + yaml_text(*place.yaw_rad);
    list += "]";
  }
  return "[" + list + "]";
}

void read_yaml_text(const std::string& yaml, SearchPlaces& search) try {
  SearchPlaces read;
  for (const auto& row : YAML::Load(yaml).as<std::vector<std::vector<double>>>()) {
    if (row.size() != 2 && row.size() != 3) throw YAML::Exception(YAML::Mark::null_mark(), "no place");
    DubinsEnd& place = read.places.emplace_back();
    place.p_m = {row[0], row[1]};
    if (row.size() == 3) place.yaw_rad = row[2];
  }
  search = read;
} catch (const YAML::Exception&) {
  throw std::invalid_argument("must be a list of [x, y] or [x, y, yaw]");
}

const char* name_of(MissionState state) {
  switch (state) {
    case MissionState::kSearch:
      return "search";
    case MissionState::kAround:
      return "around";
    case MissionState::kHold:
      return "hold";
    case MissionState::kDone:
      return "done";
  }
  return "";
}

void CircumnavigationParams::validate() const {
  avoidance.validate();
  following.validate();
  check_bounds(*this, "circumnavigation");
  check_at_least("avoidance.turn_radius_m", avoidance.turn_radius_m, "1 / following.max_curvature_1_m",
                 (1.0 - 1e-12) / following.max_curvature_1_m);
  check_at_least("standoff_m", standoff_m, "avoidance.turn_radius_m", avoidance.turn_radius_m);
  check_at_least("standoff_m", standoff_m, "avoidance.clearance_m", avoidance.clearance_m);
}

Circumnavigation::Circumnavigation(const CircumnavigationParams& params, const std::vector<DubinsEnd>& search,
                                   const std::optional<Eigen::Vector2d>& start_world_m)
    : params_(params),
      search_(search),
      start_m_(start_world_m),
      seen_(kSightSpacing_m, static_cast<std::size_t>(kSights)) {
  params_.validate();
  constexpr std::size_t kUsualText = 160, kUsualSegments = 256;
  step_.reason.reserve(kUsualText);
  missing_.reserve(kUsualText);
  obstacles_.reserve(kUsualPieces);
  for (SegmentPath* path : {&path_, &orbit_, &way_out_, &candidate_, &tried_, &approach_, &other_orbit_, &joined_}) {
    path->segments.reserve(kUsualSegments);
  }
  for (std::size_t i = 0; i < search_.size(); ++i) {
    search_[i].radius_m = params_.avoidance.turn_radius_m;
    if (!search_[i].p_m.allFinite() || !std::isfinite(search_[i].yaw_rad.value_or(0.0))) {
      throw std::invalid_argument("circumnavigation: place " + std::to_string(i) + " of the search is not finite");
    }
  }
}

Circumnavigation::Watched* Circumnavigation::watched(std::uint64_t id) { return with_id(watched_, id); }

bool Circumnavigation::is_together(std::uint64_t id) const {
  return std::find(together_.begin(), together_.end(), id) != together_.end();
}

bool Circumnavigation::is_given_up(std::uint64_t id) const {
  const Watched* watched = with_id(watched_, id);
  return watched != nullptr && (watched->given_up || watched->around_rad > 2.0 * kPi * params_.max_laps);
}

/// What was done stays done, although a scan opens it again, unless more of it appears.
bool Circumnavigation::is_done(const Splinegon& boundary) const {
  const Watched* watched = with_id(watched_, boundary.id);
  return watched != nullptr && watched->done && chord_length_m(boundary) <= kMoreOutline * watched->length_m;
}

/// It is along or within another one that is done or given up: the same obstacle, mapped again beside itself by a pose
/// that wanders.
bool Circumnavigation::is_known_already(const Splinegon& boundary) const {
  const double sigma_m = greatest_sigma_m(boundary);
  for (const Splinegon& other : boundaries_) {
    if (other.id == boundary.id || !(is_done(other) || is_given_up(other.id))) continue;
    const double apart_m = std::max(std::hypot(sigma_m, greatest_sigma_m(other)), kSameOutline_m);
    const auto on_it = std::count_if(boundary.vertices.begin(), boundary.vertices.end(), [&](const auto& vertex) {
      return contains(other, vertex.p_world_m) || distance_m(other, vertex.p_world_m) < apart_m;
    });
    if (static_cast<double>(on_it) >= kMostOfOutline * static_cast<double>(boundary.vertices.size())) return true;
  }
  return false;
}

/// Something that is to be gone around yet. What is the same as another one is found out now and then: that takes long.
bool Circumnavigation::is_left(const Splinegon& boundary) {
  if (boundary.vertices.empty() || is_done(boundary) || is_given_up(boundary.id)) return false;
  Watched& known = *watched(boundary.id);
  if (known.compared_ns == StampOrder::kNone || seconds_between(known.compared_ns, now_ns_) >= kReplan_s) {
    known.compared_ns = now_ns_;
    known.twice = is_known_already(boundary);
  }
  return !known.twice;
}

/// Done is what stays closed and certain for a while.
void Circumnavigation::watch_boundaries() {
  for (Watched& watched : watched_) watched.present = with_id(boundaries_, watched.id) != nullptr;
  for (const Splinegon& boundary : boundaries_) {
    const bool is_certain = boundary.closed && greatest_sigma_m(boundary) <= params_.max_sigma_m;
    if (boundary.vertices.empty()) continue;
    Watched* known = watched(boundary.id);
    if (known == nullptr) {
      // Maybe what another one became a part of.
      double around_rad = 0.0;
      for (const Watched& other : watched_) {
        if (other.present || other.done || other.around_rad <= around_rad) continue;
        if (distance_m(boundary, other.place_m) < params_.standoff_m) around_rad = other.around_rad;
      }
      known = &watched_.emplace_back();
      known->id = boundary.id;
      known->around_rad = around_rad;
    }
    known->place_m = boundary.vertices[boundary.vertices.size() / 2].p_world_m;
    if (is_certain) {
      if (!known->certain) known->since_ns = now_ns_;
      known->length_m = chord_length_m(boundary);
      known->done = known->done || seconds_between(known->since_ns, now_ns_) >= kSettled_s;
    }
    known->certain = is_certain;
  }
}

/// A turn around the target is one around all that its orbit goes around.
void Circumnavigation::count_turn(double turn_rad) {
  for (Watched& each : watched_) {
    if (each.id == target_ || (each.present && is_together(each.id))) each.around_rad += turn_rad;
  }
}

/// One that was made at a time that is not near to now says nothing.
void Circumnavigation::note(Made& made, std::int64_t stamp_ns, double max_age_s, const MissionInput& input) const {
  if (stamp_ns == made.stamp_ns) return;
  made.stamp_ns = stamp_ns;
  const double age_s = seconds_between(stamp_ns, input.stamp_ns);
  if (age_s <= max_age_s && age_s >= -kMostAhead_s)
    made.made_ns = now_ns_ - std::max<std::int64_t>(nanoseconds(age_s), 0);
}

bool Circumnavigation::is_old(const Made& made, double max_age_s) const {
  return made.made_ns == StampOrder::kNone || seconds_between(made.made_ns, now_ns_) > max_age_s;
}

/// Not one that is repeated, nor one that says nothing, nor one whose beams go on behind what is mapped.
bool Circumnavigation::is_trusted(const FreeBeams& sight) {
  const auto says_something = [](double free_m) { return free_m > 0.0; };
  if (std::none_of(sight.free_m.begin(), sight.free_m.end(), says_something)) return false;
  same_scans_ = !sight.hits_world_m.empty() && sight.free_m == free_before_m_ ? same_scans_ + 1 : 1;
  free_before_m_.assign(sight.free_m.begin(), sight.free_m.end());
  if (same_scans_ >= kSameScans && velocity_m_s_.norm() > 0.0) return false;
  int crossing = 0, passing = 0;
  const Eigen::Vector2d& p_m = sight.T_world_sensor.translation_m;
  for (std::size_t i = 0; i < sight.free_m.size(); i += std::max<std::size_t>(sight.free_m.size() / kLookedAt, 1)) {
    const double angle_rad = sight.T_world_sensor.yaw_rad + sight.from_rad + sight.step_rad * static_cast<double>(i);
    const Eigen::Vector2d along(std::cos(angle_rad), std::sin(angle_rad));
    const Curve beam{p_m, along, 0.0, sight.free_m[i]};
    bool crosses = false, passes = false;
    for (const ObstaclePiece& piece : obstacles_.pieces()) {
      const Eigen::Vector2d to_m = piece.middle_m - p_m;
      const double least_m = std::max(to_m.norm() - piece.half_m, 0.0);
      if (least_m > sight.free_m[i] || to_m.dot(along) < -piece.half_m || std::abs(cross(along, to_m)) > piece.half_m) {
        continue;
      }
      const std::optional<double> at_m = first_nearer_m(beam, piece.curve, 0.01);
      if (!at_m) continue;
      crosses = true;
      passes = passes || *at_m + kBehind_m + 3.0 * std::hypot(piece.sigma_m, pose_sigma_m_) < sight.free_m[i];
    }
    crossing += crosses ? 1 : 0;
    passing += passes ? 1 : 0;
  }
  return crossing < kFewestCrossing || passing <= kPassing * crossing;
}

void Circumnavigation::find_missing(const MissionInput& input) {
  std::array<char, 96> text{};
  const auto age = [&](const Made& made, double max_age_s, const char* what) {
    if (!is_old(made, max_age_s)) return false;
    if (made.made_ns == StampOrder::kNone) {
      std::snprintf(text.data(), text.size(), "no %s yet", what);
    } else {
      std::snprintf(text.data(), text.size(), "no %s for %.1f s", what, seconds_between(made.made_ns, now_ns_));
    }
    return true;
  };
  if (is_lost_ && input.has_pose) {
    std::snprintf(text.data(), text.size(), "odometry does not move as it says");
  } else if (is_lost_) {
    std::snprintf(text.data(), text.size(), "no odometry for %.1f s", lost_s_);
  } else if (!age(map_made_, params_.max_map_age_s, "map")) {
    age(scan_made_, params_.max_scan_age_s, "scan that can be used");
  }
  missing_.assign(text.data());
}

void Circumnavigation::take_sight(const MissionInput& input) {
  if (input.sight == nullptr) return;
  hits_.add(*input.sight, 2.0 * (params_.standoff_m + params_.avoidance.turn_radius_m), now_ns_);
  if (!is_trusted(*input.sight)) return;
  scan_made_.made_ns = now_ns_;
  if (!is_lost_) seen_.add(*input.sight);
}

void Circumnavigation::gather(const MissionInput& input) {
  if (input.map != nullptr) {
    note(map_made_, input.map->stamp_ns, params_.max_map_age_s, input);
    boundaries_ = outlines_of_large_obstacles(*input.map, params_.min_extent_m, std::move(boundaries_));
  } else {
    boundaries_.clear();
  }
  if (!is_lost_) {
    const Eigen::Matrix2d place = input.covariance_world.topLeftCorner<2, 2>();
    pose_sigma_m_ = std::sqrt(
        std::max(Eigen::SelfAdjointEigenSolver<Eigen::Matrix2d>().computeDirect(place).eigenvalues()[1], 0.0));
  }
  if (!started_) seen_.set_start(start_m_.value_or(input.T_world_base.translation_m), params_.start_free_m);
  obstacles_.clear();
  // By dead reckoning the map comes off the world; what a scan hits is where it is.
  if (is_lost_) take_sight(input);
  const bool map_counts = !is_lost_ || is_old(scan_made_, params_.max_scan_age_s);
  if (map_counts && input.map != nullptr) {
    for (const Feature& feature : input.map->features) obstacles_.add(feature);
  }
  if (!is_lost_) take_sight(input);
  hits_.add_to(obstacles_, now_ns_, map_counts && !is_old(map_made_, params_.max_map_age_s));
}

/// Nothing leads there: it is within an obstacle, or nearer than the clearance.
bool Circumnavigation::is_occupied(const Eigen::Vector2d& p_world_m) const {
  return distance_m(obstacles_, p_world_m) < params_.standoff_m ||
         std::any_of(boundaries_.begin(), boundaries_.end(),
                     [&](const Splinegon& boundary) { return contains(boundary, p_world_m); });
}

void Circumnavigation::begin_task(std::uint64_t target) {
  has_target_ = target != 0;
  target_ = target;
  chose_side_ = tried_other_side_ = false;
  around_m_ = held_s_ = 0.0;
  needs_plan_ = task_is_new_ = true;
  clear(orbit_);
}

void Circumnavigation::follow_target(const MissionInput& input) {
  const Splinegon& target = *with_id(boundaries_, target_);
  target_place_m_ = nearest_on(target, input.T_world_base.translation_m).p_world_m;
  target_sigma_m_ = greatest_sigma_m(target);
  target_is_closed_ = target.closed;
  for (std::size_t i = 0; i < obstacles_.obstacles().size(); ++i) {
    const Obstacle& obstacle = obstacles_.obstacles()[i];
    if (obstacle.kind != ObstacleKind::kObject && obstacle.id == target_) target_obstacle_ = i;
  }
  const Eigen::Vector2d middle_m = middle_of(target);
  const Eigen::Vector2d from_m = before_m_ - middle_m, to_m = input.T_world_base.translation_m - middle_m;
  around_m_ += (to_m - from_m).norm();
  count_turn(side_ * std::atan2(cross(from_m, to_m), from_m.dot(to_m)));
}

void Circumnavigation::look_for_places(const MissionInput& input) {
  while (place_ < search_.size()) {
    const Eigen::Vector2d& p_m = search_[place_].p_m;
    const bool is_there = (input.T_world_base.translation_m - p_m).norm() < params_.arrive_m;
    if (!is_there && !is_occupied(p_m)) break;
    ++place_;
    begin_task(0);
  }
  is_finished_ = place_ >= search_.size();
}

void Circumnavigation::lose_patience() {
  // By the way too: turns are about a middle that moves while the boundary grows.
  const bool too_many_laps =
      has_target_ &&
      (is_given_up(target_) || around_m_ > (params_.max_laps + 1.0) * std::max(orbit_.length_m, kShortOrbit_m));
  if (has_target_ && held_s_ > params_.patience_s / 3.0 && !tried_other_side_) {
    side_ = -side_;
    watched(target_)->around_rad = 0.0;
    tried_other_side_ = chose_side_ = true;
    needs_plan_ = true;
  }
  if (held_s_ <= params_.patience_s && !too_many_laps) return;
  if (has_target_) {
    watched(target_)->given_up = true;
  } else if (!is_finished_) {
    ++place_;
    ++places_given_up_;
  }
  begin_task(0);
}

/// The nearest boundary that is left, else the next place of the search.
void Circumnavigation::choose_task(const MissionInput& input) {
  const bool had_target = has_target_;
  if (has_target_) {
    const Splinegon* target = with_id(boundaries_, target_);
    if (target != nullptr && is_done(*target)) begin_task(0);
    lose_patience();
    // It became a part of another one, or of none.
    if (has_target_ && target == nullptr) begin_task(0);
  } else {
    lose_patience();
  }
  if (!has_target_) {
    double least_m = kInfinite;
    const Splinegon* nearest = nullptr;
    for (const Splinegon& boundary : boundaries_) {
      if (!is_left(boundary)) continue;
      const double each_m = distance_m(boundary, input.T_world_base.translation_m);
      if (each_m >= least_m) continue;
      least_m = each_m;
      nearest = &boundary;
    }
    if (nearest != nullptr) {
      // On in the same direction, if that is what it is gone around with already.
      const bool goes_on =
          had_target && (is_together(nearest->id) || distance_m(*nearest, target_place_m_) < params_.standoff_m);
      begin_task(nearest->id);
      chose_side_ = goes_on;
    }
  }
  if (has_target_) {
    is_finished_ = false;
    follow_target(input);
  } else {
    look_for_places(input);
  }
}

void Circumnavigation::report(const MissionInput& input) {
  std::array<char, 160> text{};
  const auto place = static_cast<unsigned long>(place_ + 1), places = static_cast<unsigned long>(search_.size());
  const auto id = static_cast<unsigned long>(target_);
  const auto boundaries = static_cast<unsigned long>(boundaries_.size());
  unsigned long done = 0, given_up = 0;
  for (const Splinegon& boundary : boundaries_) {
    if (is_done(boundary)) {
      ++done;
    } else if (is_given_up(boundary.id)) {
      ++given_up;
    }
  }
  if (!missing_.empty() && (is_lost_ || has_target_ || !is_finished_)) {
    step_.state = MissionState::kHold;
    std::snprintf(text.data(), text.size(), "%s: on a circle", missing_.c_str());
  } else if (!has_target_ && is_finished_) {
    step_.state = MissionState::kDone;
    std::snprintf(text.data(), text.size(),
                  "all boundaries are closed and certain, but for %lu given up and %lu along others; all places were "
                  "visited",
                  given_up, boundaries - done - given_up);
  } else if (holds_ && has_target_) {
    step_.state = MissionState::kHold;
    std::snprintf(text.data(), text.size(), "no safe path around boundary %lu for %.0f s", id, held_s_);
  } else if (holds_) {
    step_.state = MissionState::kHold;
    std::snprintf(text.data(), text.size(), "no safe path to place %lu of %lu for %.0f s", place, places, held_s_);
  } else if (has_target_) {
    step_.state = MissionState::kAround;
    if (target_is_closed_ && target_sigma_m_ <= params_.max_sigma_m) {
      std::snprintf(text.data(), text.size(), "boundary %lu was closed just now", id);
    } else if (target_is_closed_) {
      std::snprintf(text.data(), text.size(), "boundary %lu is closed and known to %.2f m, not yet to %.2f m", id,
                    target_sigma_m_, params_.max_sigma_m);
    } else {
      std::snprintf(text.data(), text.size(), "boundary %lu is open", id);
    }
  } else {
    step_.state = MissionState::kSearch;
    std::snprintf(text.data(), text.size(), "on the way to place %lu of %lu", place, places);
  }
  step_.reason.assign(text.data());
  step_.way_m = way_m_;
  step_.speed_m_s = input.speed_m_s;
  step_.target = has_target_ ? target_ : 0;
  step_.laps = has_target_ ? watched(target_)->around_rad / (2.0 * kPi) : 0.0;
  step_.given_up = given_up + places_given_up_;
  step_.done = done;
}

const MissionStep& Circumnavigation::step(const MissionInput& given) {
  if (given.has_pose &&
      (!given.T_world_base.translation_m.allFinite() || !std::isfinite(given.T_world_base.yaw_rad) ||
       !std::isfinite(given.speed_m_s) || given.speed_m_s < 0.0 || !given.covariance_world.allFinite())) {
    throw std::invalid_argument("circumnavigation: pose, covariance and speed must be finite, the speed not negative");
  }
  if (!given.has_pose && !started_) throw std::invalid_argument("circumnavigation: there is no pose yet");
  const std::int64_t before_ns = now_ns_;
  now_ns_ = clock_.advance(given.stamp_ns);
  const double since_s = seconds_between(before_ns, now_ns_);
  const bool was_lost = is_lost_;
  const MissionInput input = with_pose(given, since_s);
  lost_s_ = is_lost_ ? lost_s_ + since_s : 0.0;
  if (!started_) before_m_ = input.T_world_base.translation_m;
  if (!was_lost && is_lost_) known_hits_ = hits_;
  if (was_lost && !is_lost_) {
    // The circle, and what was hit since, are where dead reckoning said.
    hits_ = known_hits_;
    clear(path_);
    clear(way_out_);
    way_m_ = 0.0;
  }
  gather(input);
  find_missing(given);
  if (missing_.empty()) watch_boundaries();
  started_ = true;
  const bool may_go = missing_.empty();
  if (holds_ && may_go) held_s_ += since_s;
  if (may_go) choose_task(input);
  before_m_ = input.T_world_base.translation_m;

  DubinsFollowingResult told;
  const auto follow_path = [&] {
    if (path_.segments.empty()) return;
    told = follow(path_, params_.following, input.T_world_base, input.speed_m_s, way_m_);
    way_m_ = told.way_m;
  };
  follow_path();
  if (!path_.segments.empty() && std::abs(told.error.across_m) > kOffPath * params_.avoidance.turn_radius_m) {
    clear(path_);
    clear(way_out_);
    holds_ = true;
  }
  const double since_plan_s = seconds_between(planned_ns_, now_ns_);
  const bool is_done = !has_target_ && is_finished_;
  const bool due = since_plan_s >= (holds_ ? 0.5 : 1.0) * kReplan_s;
  bool wants = task_is_new_ || path_.segments.empty() || (!holds_ && told.arrived) ||
               (due && (needs_plan_ || holds_ || has_target_));
  task_is_new_ = false;
  if (!wants && !holds_ && due) {
    planned_ns_ = now_ns_;
    wants = !check(path_, way_m_, path_.length_m, obstacles_, pose_sigma_m_, params_.avoidance).free;
  }
  if (wants && !is_done && may_go) {
    planned_ns_ = now_ns_;
    if (plan(input) && is_safe(candidate_, 0.0, input.speed_m_s)) {
      std::swap(path_, candidate_);
      way_m_ = 0.0;
      ++step_.path_number;
      if (holds_) held_s_ = std::max(held_s_ - 1.0, 0.0);
      holds_ = false;
      needs_plan_ = false;
      follow_path();
    }
  }
  if (!holds_ &&
      (!may_go || is_done || path_.segments.empty() || told.arrived || !is_safe(path_, way_m_, input.speed_m_s))) {
    hold();
  }
  if (holds_) turn_on(input);
  if (holds_) follow_path();
  step_.curvature_1_m = path_.segments.empty() ? 0.0 : told.curvature_1_m;
  report(input);
  return step_;
}

}  // namespace situation_awareness

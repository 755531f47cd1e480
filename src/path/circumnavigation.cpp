// SPDX-License-Identifier: BSD-3-Clause
#include "situation_awareness/path/circumnavigation.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdio>
#include <limits>
#include <stdexcept>
#include <variant>

#include <yaml-cpp/yaml.h>
#include <Eigen/Eigenvalues>

#include "situation_awareness/common/stamp_order.hpp"
#include "situation_awareness/common/time.hpp"
#include "situation_awareness/geometry/angles.hpp"
#include "situation_awareness/geometry/vectors.hpp"

namespace situation_awareness {
namespace {

constexpr double kInfinite = std::numeric_limits<double>::infinity();
/// s. Longest time between steps: for so long a decision counts.
constexpr double kStep_s = 0.3;
/// m. Between places of an orbit at which a path may join or leave it.
constexpr double kJoin_m = 3.0;
/// m, rad. A vehicle that is so near to an orbit follows it.
constexpr double kOnOrbit_m = 0.7, kOnOrbit_rad = 0.25;
/// m. Of an orbit, for which a longer way is allowed to begin with: approaching it.
constexpr double kShortOrbit_m = 100.0;
/// s. A boundary that has just been closed may open again: its ends hardly overlap.
constexpr double kSettled_s = 3.0;
/// Of the outline of a boundary that was done: from here on more of it has appeared.
constexpr double kMoreOutline = 1.2;
/// m. What is no farther from another boundary, or than the standard deviations of both are, is along that; so much of
/// the vertices, at least, of what is the same obstacle.
constexpr double kSameOutline_m = 0.5, kMostOfOutline = 0.8;
/// m, of the way that it says, of that or of its speed when flying. Odometry is looked at each so far: that moves less
/// is frozen; a vehicle that is slower does not fly.
constexpr double kFrozenWay_m = 2.0, kFrozen = 0.2;
/// Scans in a row, with hits, that say exactly the same while the vehicle moves are one that is repeated.
constexpr int kSameScans = 3;
/// Of the beams that cross what is mapped, and of these at least: if more go on behind it by so much (m), the scan or
/// the map is wrong. Of all beams so many are looked at.
constexpr double kPassing = 0.5, kBehind_m = 2.0;
constexpr int kFewestCrossing = 5;
constexpr std::size_t kLookedAt = 180;
/// s. So much ahead of the pose nothing is from now.
constexpr double kMostAhead_s = 0.5;
/// s. Of dead reckoning, and until the wind is believed.
constexpr double kReckoning_s = 0.02, kWind_s = 5.0;
/// Of the radius of turns: farther beside its path the vehicle does not follow it.
constexpr double kOffPath = 0.5;
/// s. Of the patience with a task: what it takes to turn off from a path.
constexpr double kTurnOff_s = 6.0;
/// Of an orbit's length: how far along it a path goes.
constexpr double kOfLap = 0.95;

Pose2 pose_on(const SegmentPath& closed, double way_m) {
  return place_at(closed, std::fmod(way_m, closed.length_m)).pose;
}

DubinsEnd end_of(const Pose2& pose, double radius_m) { return {pose.translation_m, pose.yaw_rad, radius_m}; }

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

/// A part of it is so much less certain than the rest that it may be anywhere: there are hardly any hits.
bool is_partly_guessed(const Splinegon& boundary) {
  double least_m = kInfinite;
  for (const SplinegonVertex& vertex : boundary.vertices) least_m = std::min(least_m, vertex.sigma_m);
  return greatest_sigma_m(boundary) > 3.0 * least_m + 0.3;
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
      seen_(params.sight_spacing_m, static_cast<std::size_t>(params.sights)) {
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
bool Circumnavigation::is_known_already(const std::vector<Splinegon>& boundaries, const Splinegon& boundary) const {
  const double sigma_m = greatest_sigma_m(boundary);
  for (const Splinegon& other : boundaries) {
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
bool Circumnavigation::is_left(const std::vector<Splinegon>& boundaries, const Splinegon& boundary) {
  if (boundary.vertices.empty() || is_done(boundary) || is_given_up(boundary.id)) return false;
  Watched& known = *watched(boundary.id);
  if (known.compared_ns == StampOrder::kNone || seconds_between(known.compared_ns, now_ns_) >= params_.replan_s) {
    known.compared_ns = now_ns_;
    known.twice = is_known_already(boundaries, boundary);
  }
  return !known.twice;
}

/// Done is what stays closed and certain for a while.
void Circumnavigation::watch_boundaries(const MissionInput& input) {
  if (input.boundaries == nullptr) return;
  const std::vector<Splinegon>& boundaries = input.boundaries->boundaries;
  for (Watched& watched : watched_) watched.present = with_id(boundaries, watched.id) != nullptr;
  for (const Splinegon& boundary : boundaries) {
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

bool Circumnavigation::is_free(const SegmentPath& path) const {
  return check(path, 0.0, path.length_m, obstacles_, pose_sigma_m_, params_.avoidance).free;
}

/// Without a pose, or with one that cannot be: that by dead reckoning, and the sight placed by it.
MissionInput Circumnavigation::with_pose(const MissionInput& input, double since_s) {
  MissionInput placed = input;
  if (input.has_pose) {
    const double heading_rad = std::isnan(input.heading_rad) ? input.T_world_base.yaw_rad : input.heading_rad;
    check_motion(input, since_s);
    placed.has_pose = !is_frozen_;
    if (is_frozen_ && input.sight != nullptr) {
      // The sight was placed by that pose.
      const Pose2 T_base_world = inverse(Pose2{input.T_world_base.translation_m, heading_rad});
      sight_ = *input.sight;
      sight_.T_world_sensor = T_base_world * sight_.T_world_sensor;
      for (Eigen::Vector2d& hit_m : sight_.hits_world_m) hit_m = T_base_world * hit_m;
    }
  } else if (input.sight != nullptr) {
    sight_ = *input.sight;
  }
  is_lost_ = !placed.has_pose;
  reckon(placed, since_s);
  if (!is_lost_) return placed;
  placed.T_world_base = {reckoned_m_, std::atan2(velocity_m_s_.y(), velocity_m_s_.x())};
  placed.speed_m_s = velocity_m_s_.norm();
  placed.covariance_world.setZero();
  if (input.sight != nullptr) {
    const Pose2 T_world_body{reckoned_m_, heading_rad_};
    sight_.T_world_sensor = T_world_body * sight_.T_world_sensor;
    for (Eigen::Vector2d& hit_m : sight_.hits_world_m) hit_m = T_world_body * hit_m;
    placed.sight = &sight_;
  }
  return placed;
}

/// The vehicle turns as it was told, after its lag, and is carried by the wind.
void Circumnavigation::reckon(const MissionInput& input, double since_s) {
  const DubinsFollowingParams& vehicle = params_.following;
  const double airspeed_m_s = vehicle.airspeed_m_s;
  if (input.has_pose) {
    reckoned_m_ = input.T_world_base.translation_m;
    heading_rad_ = std::isnan(input.heading_rad) ? input.T_world_base.yaw_rad : input.heading_rad;
    const double course_rad = input.T_world_base.yaw_rad;
    velocity_m_s_ = input.speed_m_s * Eigen::Vector2d(std::cos(course_rad), std::sin(course_rad));
    const Eigen::Vector2d wind_m_s =
        velocity_m_s_ - airspeed_m_s * Eigen::Vector2d(std::cos(heading_rad_), std::sin(heading_rad_));
    const double part = started_ && !is_frozen_ ? std::min(since_s / kWind_s, 1.0) : 1.0;
    wind_m_s_ += part * (wind_m_s - wind_m_s_);
    turn_1_m_ = step_.curvature_1_m;
    return;
  }
  const double speed_m_s = airspeed_m_s > 0.0 ? airspeed_m_s : velocity_m_s_.norm();
  if (!(airspeed_m_s > 0.0)) wind_m_s_.setZero();
  const auto steps = static_cast<int>(std::ceil(std::min(since_s, 1.0) / kReckoning_s));
  for (int i = 0; i < steps; ++i) {
    const double step_s = std::min(since_s, 1.0) / steps;
    turn_1_m_ += (step_.curvature_1_m - turn_1_m_) * std::min(step_s / std::max(vehicle.reaction_s, step_s), 1.0);
    const double most_rad_s = vehicle.max_curvature_1_m * speed_m_s;
    const double turn_rad = std::clamp(turn_1_m_ * velocity_m_s_.norm(), -most_rad_s, most_rad_s) * step_s;
    const double middle_rad = heading_rad_ + 0.5 * turn_rad;
    heading_rad_ = wrap_to_pi(heading_rad_ + turn_rad);
    reckoned_m_ += (speed_m_s * Eigen::Vector2d(std::cos(middle_rad), std::sin(middle_rad)) + wind_m_s_) * step_s;
    velocity_m_s_ = speed_m_s * Eigen::Vector2d(std::cos(heading_rad_), std::sin(heading_rad_)) + wind_m_s_;
  }
}

/// Whether odometry says that the vehicle moves, and does not move so; or that it stands where it can only fly.
void Circumnavigation::check_motion(const MissionInput& input, double since_s) {
  if (!started_ || (is_lost_ && !is_frozen_)) {
    anchor_m_ = input.T_world_base.translation_m;
    flown_m_.setZero();
    is_frozen_ = false;
    since_s = 0.0;
  }
  const double course_rad = input.T_world_base.yaw_rad;
  flown_m_ += since_s * input.speed_m_s * Eigen::Vector2d(std::cos(course_rad), std::sin(course_rad));
  const bool stands = input.speed_m_s < kFrozen * params_.following.airspeed_m_s;
  is_frozen_ = is_frozen_ || stands;
  const double way_m = flown_m_.norm();
  if (way_m > kFrozenWay_m && !stands) {
    is_frozen_ = (input.T_world_base.translation_m - anchor_m_).dot(flown_m_) < kFrozen * way_m * way_m;
    anchor_m_ = input.T_world_base.translation_m;
    flown_m_.setZero();
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
  } else if (!age(boundaries_made_, params_.max_map_age_s, "boundaries") &&
             !(polygons_made_.made_ns != StampOrder::kNone && age(polygons_made_, params_.max_map_age_s, "polygons"))) {
    age(scan_made_, params_.max_scan_age_s, "scan that can be used");
  }
  missing_.assign(text.data());
}

void Circumnavigation::add_maps(const MissionInput& input) {
  const auto stands_for = [&](const Splinegon& boundary) {
    const Chain* chain = input.polygons != nullptr ? with_id(input.polygons->chains, boundary.id) : nullptr;
    return chain == nullptr || (boundary.last_seen_ns >= chain->last_seen_ns && !is_partly_guessed(boundary));
  };
  if (input.boundaries != nullptr) {
    for (const Splinegon& boundary : input.boundaries->boundaries) {
      if (stands_for(boundary)) obstacles_.add(boundary);
    }
  }
  if (input.polygons != nullptr) {
    for (const Chain& chain : input.polygons->chains) {
      const Splinegon* boundary =
          input.boundaries != nullptr ? with_id(input.boundaries->boundaries, chain.id) : nullptr;
      if (boundary == nullptr || !stands_for(*boundary)) obstacles_.add(chain);
    }
  }
  if (input.objects != nullptr) {
    for (const Object& object : input.objects->objects) obstacles_.add(object);
  }
}

void Circumnavigation::take_sight(const MissionInput& input) {
  if (input.sight == nullptr) return;
  hits_.add(*input.sight, 2.0 * (params_.standoff_m + params_.avoidance.turn_radius_m), now_ns_);
  if (!is_trusted(*input.sight)) return;
  scan_made_.made_ns = now_ns_;
  if (!is_lost_) seen_.add(*input.sight);
}

void Circumnavigation::gather(const MissionInput& input) {
  if (input.boundaries != nullptr) note(boundaries_made_, input.boundaries->stamp_ns, params_.max_map_age_s, input);
  if (input.polygons != nullptr) note(polygons_made_, input.polygons->stamp_ns, params_.max_map_age_s, input);
  if (!is_lost_) {
    const Eigen::Matrix2d place = input.covariance_world.topLeftCorner<2, 2>();
    pose_sigma_m_ = std::sqrt(
        std::max(Eigen::SelfAdjointEigenSolver<Eigen::Matrix2d>().computeDirect(place).eigenvalues()[1], 0.0));
  }
  if (!started_) seen_.set_start(start_m_.value_or(input.T_world_base.translation_m), params_.start_free_m);
  obstacles_.clear();
  // By dead reckoning maps come off the world; what a scan hits is where it is.
  if (is_lost_) take_sight(input);
  const bool maps_count = !is_lost_ || is_old(scan_made_, params_.max_scan_age_s);
  if (maps_count) add_maps(input);
  if (!is_lost_) take_sight(input);
  hits_.add_to(obstacles_, now_ns_, maps_count && !is_old(boundaries_made_, params_.max_map_age_s));
}

/// Nothing leads there: it is within an obstacle, or nearer than the clearance.
bool Circumnavigation::is_occupied(const MissionInput& input, const Eigen::Vector2d& p_world_m) const {
  if (distance_m(obstacles_, p_world_m) < params_.standoff_m) return true;
  return input.boundaries != nullptr &&
         std::any_of(input.boundaries->boundaries.begin(), input.boundaries->boundaries.end(),
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
  const Splinegon& target = *with_id(input.boundaries->boundaries, target_);
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
    if (!is_there && !is_occupied(input, p_m)) break;
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
  static const std::vector<Splinegon> kNoBoundaries;
  const auto& boundaries = input.boundaries != nullptr ? input.boundaries->boundaries : kNoBoundaries;
  const bool had_target = has_target_;
  if (has_target_) {
    const Splinegon* target = with_id(boundaries, target_);
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
    for (const Splinegon& boundary : boundaries) {
      if (!is_left(boundaries, boundary)) continue;
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

bool Circumnavigation::trace(std::size_t obstacle, double side, const Pose2& from, SegmentPath& orbit) {
  const double radius_m = params_.avoidance.turn_radius_m;
  const Eigen::Vector2d hint_m = from * Eigen::Vector2d(0.0, -side * radius_m);
  return orbits_.trace(obstacles_, obstacle, side, params_.standoff_m, radius_m, hint_m, orbit);
}

/// The shortest free way to an orbit, as `path`; the length, infinite if there is none. `way_m`: where it joins.
double Circumnavigation::join(const Pose2& from, const SegmentPath& orbit, SegmentPath& path, double& way_m) const {
  const double radius_m = params_.avoidance.turn_radius_m;
  clear(path);
  const double nearest = nearest_m(orbit, from.translation_m, 0.0, orbit.length_m);
  const FollowingError error = following_error(place_at(orbit, nearest).pose, from);
  way_m = nearest;
  if (std::abs(error.across_m) < kOnOrbit_m && std::abs(error.heading_rad) < kOnOrbit_rad) return 0.0;
  double best_m = kInfinite;
  DubinsPath best;
  for (double beyond_m = 0.0; beyond_m < orbit.length_m; beyond_m += kJoin_m) {
    const DubinsPath dubins =
        shortest_dubins_path(end_of(from, radius_m), end_of(pose_on(orbit, nearest + beyond_m), radius_m));
    if (dubins.length_m >= best_m) continue;
    clear(joined_);
    append(joined_, dubins);
    if (!is_free(joined_)) continue;
    best_m = dubins.length_m;
    best = dubins;
    way_m = std::fmod(nearest + beyond_m, orbit.length_m);
  }
  if (best_m < kInfinite) append(path, best);
  return best_m;
}

bool Circumnavigation::plan_along_orbit(const Pose2& from, const DubinsEnd& end, std::size_t obstacle) {
  const double radius_m = params_.avoidance.turn_radius_m;
  double best_m = kInfinite, best_blocked_m = kInfinite;
  SegmentPath& blocked = tried_;
  clear(candidate_);
  clear(blocked);
  for (const double side : {1.0, -1.0}) {
    double way_m = 0.0;
    if (!trace(obstacle, side, from, other_orbit_)) continue;
    const double join_m = join(from, other_orbit_, approach_, way_m);
    if (join_m == kInfinite) continue;
    for (double along_m = 0.0; along_m < kOfLap * other_orbit_.length_m; along_m += kJoin_m) {
      const DubinsPath exit = shortest_dubins_path(end_of(pose_on(other_orbit_, way_m + along_m), radius_m), end);
      const double whole_m = join_m + along_m + exit.length_m;
      if (whole_m >= best_m) continue;
      clear(joined_);
      append(joined_, exit);
      const PathCheck result = check(joined_, 0.0, joined_.length_m, obstacles_, pose_sigma_m_, params_.avoidance);
      if (!result.free) {
        // Else as far as it leads.
        const Eigen::Vector2d rest_m = end.p_m - place_at(joined_, result.free_m).pose.translation_m;
        const double blocked_m = join_m + along_m + result.free_m + 2.0 * rest_m.norm();
        if (best_m < kInfinite || blocked_m >= best_blocked_m || result.free_m < radius_m) continue;
        best_blocked_m = blocked_m;
      } else {
        best_m = whole_m;
      }
      SegmentPath& best = result.free ? candidate_ : blocked;
      clear(best);
      best.segments.insert(best.segments.end(), approach_.segments.begin(), approach_.segments.end());
      best.length_m = approach_.length_m;
      append_part(best, other_orbit_, way_m, way_m + along_m);
      append(best, exit);
    }
  }
  if (best_m == kInfinite) std::swap(candidate_, blocked);
  return !candidate_.segments.empty();
}

bool Circumnavigation::plan_to(const Pose2& from, const DubinsEnd& end) {
  if (plan_around(from, end, obstacles_, pose_sigma_m_, params_.avoidance, candidate_)) return true;
  clear(candidate_);
  append(candidate_, shortest_dubins_path(end_of(from, params_.avoidance.turn_radius_m), end));
  const PathCheck result = check(candidate_, 0.0, candidate_.length_m, obstacles_, pose_sigma_m_, params_.avoidance);
  return result.free || plan_along_orbit(from, end, obstacles_.pieces()[result.piece].obstacle);
}

bool Circumnavigation::plan_to_orbit(const Pose2& from) {
  double way_m = 0.0;
  if (!chose_side_) {
    // The nearer way around.
    double nearest = kInfinite;
    for (const double side : {1.0, -1.0}) {
      if (!trace(target_obstacle_, side, from, other_orbit_)) continue;
      const double each_m = join(from, other_orbit_, tried_, way_m);
      if (each_m >= nearest) continue;
      nearest = each_m;
      side_ = side;
      chose_side_ = true;
    }
  }
  if (!trace(target_obstacle_, side_, from, orbit_)) return false;
  together_.clear();
  for (const Obstacle& obstacle : obstacles_.obstacles()) {
    if (obstacle.kind != ObstacleKind::kObject &&
        turns_around(orbit_, obstacles_.pieces()[obstacle.first].curve.from_m) != 0) {
      together_.push_back(obstacle.id);
    }
  }
  if (join(from, orbit_, candidate_, way_m) < kInfinite) {
    append_part(candidate_, orbit_, way_m, way_m + kOfLap * orbit_.length_m);
    return true;
  }
  // By an intermediate pose, or around what is between.
  const double radius_m = params_.avoidance.turn_radius_m;
  const double nearest = nearest_m(orbit_, from.translation_m, 0.0, orbit_.length_m);
  double best_m = kInfinite;
  clear(tried_);
  for (const double part : {0.0, 0.15, 0.85, 0.3, 0.7, 0.5}) {
    const double at_m = nearest + part * orbit_.length_m;
    if (!plan_around(from, end_of(pose_on(orbit_, at_m), radius_m), obstacles_, pose_sigma_m_, params_.avoidance,
                     joined_) ||
        joined_.length_m >= best_m) {
      continue;
    }
    best_m = joined_.length_m;
    std::swap(tried_, joined_);
    way_m = std::fmod(at_m, orbit_.length_m);
  }
  if (best_m < kInfinite) {
    std::swap(candidate_, tried_);
    append_part(candidate_, orbit_, way_m, way_m + kOfLap * orbit_.length_m);
    return true;
  }
  return plan_to(from, end_of(pose_on(orbit_, nearest), radius_m));
}

bool Circumnavigation::plan(const MissionInput& input) {
  if (has_target_) return plan_to_orbit(input.T_world_base);
  return !is_finished_ && plan_to(input.T_world_base, search_[place_]);
}

/// From here on the path is free as far as the vehicle goes until it can turn off, and so is a circle from there, all
/// of it seen. Then that is the way out.
bool Circumnavigation::is_safe(const SegmentPath& path, double way_m, double speed_m_s) {
  const AvoidanceParams& avoidance = params_.avoidance;
  const double to_m = std::min(way_m + speed_m_s * (avoidance.reaction_s + kStep_s), path.length_m);
  if (!check(path, way_m, to_m, obstacles_, pose_sigma_m_, avoidance).free) return false;
  if (!seen_.contains(path, way_m, to_m, avoidance.clearance_m)) return false;
  const Pose2 from = place_at(path, to_m).pose;
  const double first_side = has_target_ ? -side_ : 1.0;
  for (const double side : {first_side, -first_side}) {
    clear(joined_);
    append(joined_, holding_circle(from, side, avoidance));
    if (!is_free(joined_) || !seen_.contains(joined_, 0.0, joined_.length_m, avoidance.clearance_m)) continue;
    clear(way_out_);
    append_part(way_out_, path, way_m, to_m);
    append(way_out_, joined_.segments[0]);
    return true;
  }
  return false;
}

void Circumnavigation::hold() {
  // To turn off from a path counts, too: it may be found again and again.
  if (!holds_ && !path_.segments.empty() && missing_.empty()) held_s_ += kTurnOff_s;
  holds_ = true;
  planned_ns_ = now_ns_;
  if (way_out_.segments.empty()) {
    clear(path_);
  } else {
    std::swap(path_, way_out_);
    clear(way_out_);
  }
  way_m_ = 0.0;
  ++step_.path_number;
}

/// Of a path that ends with a full circle: how far on it is free, infinite if the whole circle is.
double Circumnavigation::free_on_circle_m(const SegmentPath& path, double way_m) const {
  const PathCheck ahead = check(path, way_m, path.length_m, obstacles_, pose_sigma_m_, params_.avoidance);
  if (!ahead.free) return ahead.free_m - way_m;
  const double circle_m = path.length_m - length_m(path.segments.back());
  if (circle_m >= way_m) return kInfinite;
  const PathCheck again = check(path, circle_m, way_m, obstacles_, pose_sigma_m_, params_.avoidance);
  return again.free ? kInfinite : path.length_m - way_m + again.free_m - circle_m;
}

/// To the circle that is free as a whole, by a short way and seen, if there is one; else to that which is free
/// farthest, if that is farther than `least_m`.
bool Circumnavigation::escape(const MissionInput& input, double least_m) {
  const AvoidanceParams& avoidance = params_.avoidance;
  const double radius_m = avoidance.turn_radius_m;
  double best_m = least_m, best_worth = -kInfinite;
  bool found = false;
  for (const double first_rad : {0.0, 0.5, -0.5, 1.0, -1.0, 1.6, -1.6}) {
    for (const double straight_m : {0.0, 0.5 * radius_m, radius_m, 2.0 * radius_m}) {
      for (const double side : {1.0, -1.0}) {
        clear(joined_);
        Pose2 from = input.T_world_base;
        if (first_rad != 0.0) {
          Arc turn = holding_circle(from, std::copysign(1.0, first_rad), avoidance);
          turn.sweep_rad = first_rad;
          append(joined_, turn);
          from = place_at(joined_, joined_.length_m).pose;
        }
        if (straight_m > 0.0) {
          append(joined_, Straight{from.translation_m, from * Eigen::Vector2d(straight_m, 0.0), from.yaw_rad});
          from = place_at(joined_, joined_.length_m).pose;
        }
        append(joined_, holding_circle(from, side, avoidance));
        const double free_m = free_on_circle_m(joined_, 0.0);
        if (free_m < kInfinite && (best_m == kInfinite || free_m <= best_m)) continue;
        double worth = 0.0;
        if (free_m == kInfinite) {
          const bool is_seen = seen_.contains(joined_, 0.0, joined_.length_m, avoidance.clearance_m);
          worth = (is_seen ? 1e6 : 0.0) - joined_.length_m;
          if (best_m == kInfinite && worth <= best_worth) continue;
        }
        best_m = free_m;
        best_worth = worth;
        std::swap(tried_, joined_);
        found = true;
      }
    }
  }
  if (!found) return false;
  std::swap(path_, tried_);
  way_m_ = 0.0;
  ++step_.path_number;
  return true;
}

/// Keeps on the circle while it is free, all of it.
void Circumnavigation::turn_on(const MissionInput& input) {
  if (!path_.segments.empty() && path_.length_m - way_m_ < 0.1) {
    // The same circle again.
    const DubinsPlace place = place_at(path_, path_.length_m);
    clear(joined_);
    append(joined_, holding_circle(place.pose, place.curvature_1_m < 0.0 ? -1.0 : 1.0, params_.avoidance));
    std::swap(path_, joined_);
    way_m_ = 0.0;
    ++step_.path_number;
  }
  const double free_m = path_.segments.empty() ? -1.0 : free_on_circle_m(path_, way_m_);
  if (free_m < kInfinite) escape(input, free_m + 1.0);
}

void Circumnavigation::report(const MissionInput& input) {
  std::array<char, 160> text{};
  const auto place = static_cast<unsigned long>(place_ + 1), places = static_cast<unsigned long>(search_.size());
  const auto id = static_cast<unsigned long>(target_);
  unsigned long boundaries = 0, done = 0, given_up = 0;
  if (input.boundaries != nullptr) {
    for (const Splinegon& boundary : input.boundaries->boundaries) {
      ++boundaries;
      if (is_done(boundary)) {
        ++done;
      } else if (is_given_up(boundary.id)) {
        ++given_up;
      }
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
  if (missing_.empty()) watch_boundaries(input);
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
  const bool due = since_plan_s >= (holds_ ? 0.5 : 1.0) * params_.replan_s;
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

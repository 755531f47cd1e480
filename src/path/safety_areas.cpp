// SPDX-License-Identifier: BSD-3-Clause
#include "situation_awareness/path/safety_areas.hpp"

#include <algorithm>
#include <array>
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

using DecidedVerdict = SafetyDecision::Verdict;
using DecidedKind = SafetyDecision::Kind;

constexpr double kStep_m = 0.05;        // between the poses on the way; contacts are interpolated between them
constexpr double kRimSpacing_m = 0.05;  // of places on the outline of the footprint, for the polygons
// The error against the path gets smaller by this factor e on the way; the controller's is 1 / K3, 0.67 m.
constexpr double kSettling_m = 0.7;
constexpr double kMostHeading_rad = 1.2;     // beyond this the way that the vehicle will take is not the path
constexpr double kFlip_rad = 1.65;           // an open path is driven the other way round beyond this
constexpr double kStopTolerance_m_s = 0.05;  // so that noise of a vehicle at its allowed speed does not stop it
constexpr double kStanding_m_s = 0.02;       // slower is to stand
// A place is seen if one of these beams gets there: a shadow as narrow as that of a lost beam hides nobody.
constexpr int kBeamsToEachSide = 2;
constexpr double kSeenTolerance_m = 0.05;
constexpr double kForgetTolerance_m = 0.1;
constexpr double kRememberSpacing_m = 0.1;
constexpr std::size_t kMostRemembered = 64;
constexpr int kNeighbours = 4;  // beams on each side in which a hit may have neighbours
constexpr double kNeighbour_m = 0.2;
constexpr double kMostExplain_m = 0.25;  // however uncertain chain and pose are
constexpr int kMoverPoints = 16;
// A beam through a chain so near to a hit says that the chain is not there: about half of a person.
constexpr double kSeenThrough_m = 0.4;
constexpr double kPassSpacing_m = 0.1;
constexpr std::size_t kMostPasses = 512;
// A map that a blind scanner no longer feeds is still a map of what it should see.
constexpr double kContradiction_s = 10.0;
constexpr double kTravel_m = 0.2;  // after which the pose should have moved, by this part
constexpr double kLeastMoved = 0.25;
constexpr double kMoves_m = 0.001;  // a pose that stood still moves again
constexpr double kMostPeriod_s = 0.2;
constexpr double kNearer_m = 0.01;  // than now, from which on an unseen chain counts
constexpr double kChainSpacing_m = 0.05;

constexpr double kNoLimit = std::numeric_limits<double>::infinity();

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

bool is_known_chain(const Chain& chain, double min_p_exists) {
  return (chain.state == ChainState::kWall || chain.state == ChainState::kKnown) && chain.p_exists >= min_p_exists;
}

/// The diagonal of a box about a chain.
double extent_m(const Chain& chain) {
  Eigen::Vector2d low_m = chain.vertices.front().p_world_m, high_m = low_m;
  for (const ChainVertex& vertex : chain.vertices) {
    low_m = low_m.cwiseMin(vertex.p_world_m);
    high_m = high_m.cwiseMax(vertex.p_world_m);
  }
  return (high_m - low_m).norm();
}

/// A hit on an edge is so near to it.
double reach_of_m(const ChainVertex& from, const ChainVertex& to, const SafetyParams& params) {
  return std::min(params.explain_m + params.sigmas * std::max(from.sigma_m, to.sigma_m), kMostExplain_m);
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
    case SafetyInput::kObjects:
      return "objects";
    case SafetyInput::kPolygons:
      return "polygons";
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

/// One that says of hits in its scan, and did not see what they are on for long, is repeated with new stamps.
bool SafetyAreas::are_fresh(const Objects& objects) const {
  const double age_s = params_.max_objects_age_s;
  return is_fresh(objects.stamp_ns, age_s) &&
         std::all_of(objects.objects.begin(), objects.objects.end(),
                     [&](const Object& object) { return object.beams == 0 || is_fresh(object.last_seen_ns, age_s); });
}

/// What is not measured may be as fast as the vehicle can.
double SafetyAreas::known_speed_m_s(const VehicleState& vehicle) {
  const bool is_known = std::isfinite(vehicle.speed_m_s) &&
                        (!vehicle.speed_stamp_ns || is_fresh(*vehicle.speed_stamp_ns, params_.max_speed_age_s));
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

// --- what is in the areas

void SafetyAreas::gather_edges(const Polygons& polygons) {
  edges_.clear();
  const bool map_is_fresh = is_fresh(polygons.stamp_ns, params_.max_polygons_age_s);
  for (const Chain& chain : polygons.chains) {
    const bool is_known = is_known_chain(chain, params_.min_p_exists);
    const bool explains = map_is_fresh && is_fresh(chain.last_seen_ns, params_.max_polygons_age_s);
    const bool stands = seconds_between(chain.first_seen_ns, decision_.stamp_ns) >= params_.standing_s;
    const Weight weight = is_known ? Weight::kKnown : stands ? Weight::kStands : Weight::kMayMove;
    const std::size_t count = chain.vertices.size();
    for (std::size_t i = 0; i < count; ++i) {
      if (i + 1 == count && !chain.closed) break;
      const ChainVertex& from = chain.vertices[i];
      const ChainVertex& to = chain.vertices[(i + 1) % count];
      const Eigen::Vector2d low_m = from.p_world_m.cwiseMin(to.p_world_m),
                            high_m = from.p_world_m.cwiseMax(to.p_world_m);
      const bool beside =
          ((low_m - high_m_).array() > kMostExplain_m).any() || ((low_m_ - high_m).array() > kMostExplain_m).any();
      if (beside) continue;
      edges_.push_back({from.p_world_m, to.p_world_m, reach_of_m(from, to, params_), weight, chain.id, explains});
    }
  }
}

/// What the scan should see of the chains, near and far, and which of them it sees through.
void SafetyAreas::view_chains(const Points& points, const Polygons& polygons) {
  view_.begin(points, params_.reliable_range_m, params_.sigmas * sigma_m_, params_.sigmas * sigma_rad_);
  const bool map_is_fresh = is_fresh(polygons.stamp_ns, kContradiction_s);
  for (const Chain& chain : polygons.chains) {
    if (chain.vertices.empty()) continue;
    const bool was_seen = map_is_fresh && is_fresh(chain.last_seen_ns, kContradiction_s);
    const bool is_known = is_known_chain(chain, params_.min_p_exists);
    const bool is_fixed = chain.state == ChainState::kWall || extent_m(chain) >= ChainView::kFixed_m;
    const std::size_t count = chain.vertices.size();
    for (std::size_t i = 0; i + 1 < count + (chain.closed ? 1 : 0); ++i) {
      const ChainVertex& from = chain.vertices[i];
      const ChainVertex& to = chain.vertices[(i + 1) % count];
      view_.add(from.p_world_m, to.p_world_m, reach_of_m(from, to, params_), chain.id, is_known, is_fixed, was_seen);
    }
  }
  view_.judge();
  // A single beam may be lost: of two neighbours that pass through the same chain, the place where the second does.
  seen_through_.clear();
  const std::vector<ChainView::Beam>& beams = view_.beams();
  const auto passes = [](const ChainView::Beam& beam) {
    return beam.was_seen && (beam.look == ChainView::Look::kPasses || beam.look == ChainView::Look::kWithoutReturn);
  };
  for (std::size_t i = 1; i < beams.size() && seen_through_.size() < kMostPasses; ++i) {
    if (!passes(beams[i]) || !passes(beams[i - 1]) || beams[i].id != beams[i - 1].id) continue;
    const double azimuth_rad = points.points[i].azimuth_rad;
    const Eigen::Vector2d p_world_m =
        points.T_world_level * (beams[i].near_m * Eigen::Vector2d(std::cos(azimuth_rad), std::sin(azimuth_rad)));
    const bool is_new = seen_through_.empty() || seen_through_.back().id != beams[i].id ||
                        (seen_through_.back().p_world_m - p_world_m).norm() >= kPassSpacing_m;
    if (is_new) seen_through_.push_back({p_world_m, beams[i].id});
  }
}

bool SafetyAreas::is_seen_through(const Edge& edge, const Eigen::Vector2d& p_world_m) const {
  return std::any_of(seen_through_.begin(), seen_through_.end(), [&](const SeenThrough& place) {
    return place.id == edge.id && (place.p_world_m - p_world_m).squaredNorm() <= kSeenThrough_m * kSeenThrough_m;
  });
}

void SafetyAreas::gather_movers(const Objects& objects, std::int64_t stamp_ns) {
  movers_.clear();
  if (!are_fresh(objects)) return;
  const double age_s = seconds_between(objects.stamp_ns, stamp_ns);
  for (const Object& object : objects.objects) {
    if (object.p_exists < params_.min_p_exists) continue;
    Ellipse ellipse = object.ellipse_world;
    ellipse.center_m += age_s * object.velocity_world_m_s;
    if (!is_near(ellipse.center_m, std::max(ellipse.rx_m, ellipse.ry_m))) continue;
    const bool moves = object.p_moving >= 0.5 || object.object_class == ObjectClass::kPerson;
    const bool stands = seconds_between(object.first_seen_ns, stamp_ns) >= params_.standing_s;
    movers_.push_back({ellipse, moves || !stands ? Weight::kMayMove : Weight::kStands, object.id});
    if (!moves) continue;
    // It counts itself, also where the scan does not see it.
    for (int i = 0; i < kMoverPoints; ++i) {
      const double angle_rad = 2.0 * kPi * i / kMoverPoints;
      const Eigen::Vector2d p_ellipse_m(ellipse.rx_m * std::cos(angle_rad), ellipse.ry_m * std::sin(angle_rad));
      const Eigen::Vector2d p_world_m = ellipse.center_m + Eigen::Rotation2Dd(ellipse.psi_rad) * p_ellipse_m;
      if (is_near(p_world_m)) things_.push_back({p_world_m, Weight::kMayMove, DecidedKind::kObject, object.id});
    }
  }
}

/// What a hit is on. Movers come first: where they are beside a wall, the wall explains nothing.
void SafetyAreas::explain(Thing& thing) const {
  const auto take = [&thing](Weight weight, DecidedKind kind, std::uint64_t id) {
    thing.weight = weight;
    thing.kind = kind;
    thing.id = id;
  };
  const Mover* standing = nullptr;
  for (const Mover& mover : movers_) {
    const double most_m = std::max(mover.ellipse.rx_m, mover.ellipse.ry_m) + params_.explain_m;
    if ((thing.p_world_m - mover.ellipse.center_m).squaredNorm() > most_m * most_m) continue;
    if (offset_m(mover.ellipse, thing.p_world_m) > params_.explain_m) continue;
    if (mover.weight == Weight::kMayMove) return take(mover.weight, DecidedKind::kObject, mover.id);
    standing = &mover;
  }
  const Edge* nearest = nullptr;
  double nearest_m = kNoLimit;
  for (const Edge& edge : edges_) {
    if (!edge.explains) continue;
    const double d_m = distance_from_segment_m(thing.p_world_m, edge.from_m, edge.to_m);
    if (d_m > edge.reach_m || is_seen_through(edge, thing.p_world_m)) continue;
    // A known chain explains it rather than one that is not; of several alike the nearest does.
    if (nearest != nullptr && std::pair(nearest->weight, -nearest_m) >= std::pair(edge.weight, -d_m)) continue;
    nearest = &edge;
    nearest_m = d_m;
  }
  if (nearest != nullptr && nearest->weight != Weight::kMayMove) {
    return take(nearest->weight, DecidedKind::kChain, nearest->id);
  }
  if (standing != nullptr) return take(standing->weight, DecidedKind::kObject, standing->id);
  if (nearest != nullptr) take(nearest->weight, DecidedKind::kChain, nearest->id);
}

void SafetyAreas::gather_things(const Points& points) {
  const double beside_m = reach_m_ + margins_.protective_m + warning_margin_m(full_speed_m_s_);
  for (std::size_t i = 0; i < points.points.size(); ++i) {
    const Point& point = points.points[i];
    Thing thing;
    thing.point = static_cast<int>(i);
    if (point.state == BeamState::kHit) {
      thing.p_world_m = points.T_world_level * point.p_level_m;
    } else if (point.state == BeamState::kTooClose) {
      thing.p_world_m = points.T_world_level.translation_m;  // nearer than the scanner can measure
    } else {
      continue;
    }
    if (!is_near(thing.p_world_m)) continue;
    const bool is_beside = std::any_of(steps_.begin(), steps_.end(), [&](const Step& step) {
      return (step.pose.translation_m - thing.p_world_m).squaredNorm() <= beside_m * beside_m;
    });
    if (!is_beside) continue;
    explain(thing);
    things_.push_back(thing);
  }
}

/// Places of chains that the scan does not see, which the tail of the footprint may swing into.
void SafetyAreas::gather_unseen_chains(const Points& points) {
  const Pose2 T_level_world = inverse(points.T_world_level);
  const double beside_m = reach_m_ + margins_.floor_m;
  for (const Edge& edge : edges_) {
    const int pieces = std::max(1, static_cast<int>(std::ceil((edge.to_m - edge.from_m).norm() / kChainSpacing_m)));
    for (int k = 0; k <= pieces; ++k) {
      const Eigen::Vector2d p_world_m = edge.from_m + (static_cast<double>(k) / pieces) * (edge.to_m - edge.from_m);
      if (!is_near(p_world_m)) continue;
      const bool is_beside = std::any_of(steps_.begin(), steps_.end(), [&](const Step& step) {
        return (step.pose.translation_m - p_world_m).squaredNorm() <= beside_m * beside_m;
      });
      if (!is_beside) continue;
      const Eigen::Vector2d p_level_m = T_level_world * p_world_m;
      if (seen_range_m(points, p_level_m) >= p_level_m.norm() - kForgetTolerance_m) continue;
      things_.push_back({p_world_m, Weight::kUnseen, DecidedKind::kChain, edge.id});
    }
  }
}

/// Unknown hits without neighbours, as at edges between near and far, count in the hard floor alone.
void SafetyAreas::count_neighbours() {
  const auto is_unknown = [](const Thing& thing) { return thing.kind == DecidedKind::kUnknownHit && thing.point >= 0; };
  for (std::size_t i = 0; i < things_.size(); ++i) {
    Thing& thing = things_[i];
    if (!is_unknown(thing)) continue;
    int hits = 1;
    const auto look = [&](std::size_t k) {
      const int apart = std::abs(things_[k].point - thing.point);
      if (things_[k].point < 0 || apart > kNeighbours * params_.min_hits) return false;
      const bool is_neighbour =
          is_unknown(things_[k]) && (things_[k].p_world_m - thing.p_world_m).norm() <= kNeighbour_m;
      hits += is_neighbour ? 1 : 0;
      return true;
    };
    for (std::size_t k = i; k-- > 0 && look(k);) {
    }
    for (std::size_t k = i + 1; k < things_.size() && look(k); ++k) {
    }
    if (hits < params_.min_hits) thing.weight = Weight::kFloorAlone;
  }
}

/// The range to which the scan sees in the direction of a place; 0 where it does not look.
double SafetyAreas::seen_range_m(const Points& points, const Eigen::Vector2d& p_level_m) const {
  if (points.points.empty()) return 0.0;
  const double first_rad = points.points.front().azimuth_rad, last_rad = points.points.back().azimuth_rad;
  double azimuth_rad = std::atan2(p_level_m.y(), p_level_m.x());
  azimuth_rad += 2.0 * kPi * std::ceil((first_rad - azimuth_rad) / (2.0 * kPi));
  if (azimuth_rad > last_rad + points.resolution_rad && !points.full_circle) return 0.0;
  const auto at = std::lower_bound(points.points.begin(), points.points.end(), azimuth_rad,
                                   [](const Point& point, double a_rad) { return point.azimuth_rad < a_rad; });
  const auto count = static_cast<std::ptrdiff_t>(points.points.size());
  const std::ptrdiff_t middle = at - points.points.begin();
  double range_m = 0.0;
  for (std::ptrdiff_t i = middle - kBeamsToEachSide; i < middle + kBeamsToEachSide; ++i) {
    if (!points.full_circle && (i < 0 || i >= count)) continue;
    const Point& point = points.points[static_cast<std::size_t>(((i % count) + count) % count)];
    if (is_hit(point.state) || point.state == BeamState::kFree) range_m = std::max(range_m, point.range_m);
  }
  return range_m;
}

/// What counted before and is out of view still counts. What the present scan sees, or sees through, it says itself.
void SafetyAreas::recall(const Points& points) {
  const Pose2 T_level_world = inverse(points.T_world_level);
  const auto forget = [&](const Remembered& place) {
    const double age_s = seconds_between(place.stamp_ns, points.stamp_ns);
    if (age_s < 0.0 || age_s > params_.memory_s) return true;
    const Eigen::Vector2d p_level_m = T_level_world * place.p_world_m;
    if (seen_range_m(points, p_level_m) >= p_level_m.norm() - kForgetTolerance_m) return true;
    Thing thing;
    thing.p_world_m = place.p_world_m;
    explain(thing);
    return thing.weight != Weight::kMayMove;
  };
  remembered_.erase(std::remove_if(remembered_.begin(), remembered_.end(), forget), remembered_.end());
  for (const Remembered& place : remembered_) {
    if (is_near(place.p_world_m)) things_.push_back({place.p_world_m, Weight::kMayMove, DecidedKind::kUnknownHit, 0});
  }
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

const SafetyDecision& SafetyAreas::update(const Points& points, const VehicleState& vehicle, const Polygons& polygons,
                                          const Objects& objects, const std::vector<float>& ranges_m) {
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

  if (!are_fresh(objects)) decision_.missing.push_back(SafetyInput::kObjects);
  if (!is_fresh(polygons.stamp_ns, params_.max_polygons_age_s)) decision_.missing.push_back(SafetyInput::kPolygons);
  if (!decision_.missing.empty()) decision_.policy = SafetyPolicy::kConservative;
  const double present_m_s = known_speed_m_s(vehicle);
  const bool is_known_well = take_covariance(vehicle.covariance_world);
  const bool is_finite = vehicle.T_world_base.translation_m.allFinite() && std::isfinite(vehicle.T_world_base.yaw_rad);
  if (!is_finite) return decision_;
  const bool speed_is_known = std::count(decision_.missing.begin(), decision_.missing.end(), SafetyInput::kSpeed) == 0;
  const bool pose_is_frozen = pose_stands_still(vehicle, speed_is_known);
  const bool is_frozen = repeated_.add(ranges_m, points);
  if (!is_known_well || pose_is_frozen) return decision_;
  T_world_base_ = vehicle.T_world_base;
  view_chains(points, polygons);
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
  gather_edges(polygons);
  gather_movers(objects, points.stamp_ns);
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

// --- the polygons

/// Frames along the way, from behind the vehicle to ahead of where it stops.
void SafetyAreas::make_frames() {
  const double beyond_m = reach_m_ + margins_.protective_m + warning_margin_m(full_speed_m_s_);
  const auto beyond = static_cast<std::size_t>(std::ceil(beyond_m / kStep_m)) + 1;
  frames_.clear();
  for (std::size_t i = beyond; i > 0; --i) {
    frames_.emplace_back(T_world_base_ * Pose2{{-kStep_m * static_cast<double>(i), 0.0}, 0.0});
  }
  first_frame_ = frames_.size();
  frames_.insert(frames_.end(), steps_.begin(), steps_.end());
  const Pose2 last = steps_.back().pose;
  for (std::size_t i = 1; i <= beyond; ++i) {
    frames_.emplace_back(last * Pose2{{kStep_m * static_cast<double>(i), 0.0}, 0.0});
  }
}

/// The outline of what the footprint sweeps on a way, with a margin, by its widths to the left and to the right of each
/// frame.
void SafetyAreas::sweep(double way_m, double margin_m, std::vector<Eigen::Vector2d>& polygon_world_m) {
  const std::size_t count = frames_.size();
  left_m_.assign(count, -kNoLimit);
  right_m_.assign(count, -kNoLimit);
  const auto swept = std::min(steps_.size(), static_cast<std::size_t>(std::ceil(way_m / kStep_m)) + 1);
  std::size_t first = count, last = 0;
  for (std::size_t k = 0; k < swept; ++k) {
    for (const Eigen::Vector2d& rim_m : rim_m_) {
      const Eigen::Vector2d p_world_m = steps_[k].to_world(rim_m);
      const auto guess = static_cast<std::ptrdiff_t>(first_frame_ + k) + std::lround(rim_m.x() / kStep_m);
      std::size_t nearest = 0;
      double nearest_m2 = kNoLimit;
      for (std::ptrdiff_t i = guess - 2; i <= guess + 2; ++i) {
        const auto j =
            static_cast<std::size_t>(std::clamp<std::ptrdiff_t>(i, 0, static_cast<std::ptrdiff_t>(count) - 1));
        const double d_m2 = (frames_[j].pose.translation_m - p_world_m).squaredNorm();
        if (d_m2 < nearest_m2) {
          nearest_m2 = d_m2;
          nearest = j;
        }
      }
      const double across_m = frames_[nearest].to_base(p_world_m).y();
      left_m_[nearest] = std::max(left_m_[nearest], across_m);
      right_m_[nearest] = std::max(right_m_[nearest], -across_m);
      first = std::min(first, nearest);
      last = std::max(last, nearest);
    }
  }
  for (std::size_t i = first + 1; i <= last; ++i) {
    if (left_m_[i] == -kNoLimit) left_m_[i] = left_m_[i - 1];
    if (right_m_[i] == -kNoLimit) right_m_[i] = right_m_[i - 1];
  }
  const auto widen = [&](const std::vector<double>& widths_m, double by_m, std::vector<double>& wide_m) {
    wide_m.assign(count, -kNoLimit);
    const auto reach = static_cast<std::size_t>(by_m / kStep_m);
    for (std::size_t i = first; i <= last; ++i) {
      for (std::size_t j = i > reach ? i - reach : 0; j <= std::min(i + reach, count - 1); ++j) {
        const double along_m = kStep_m * (static_cast<double>(j) - static_cast<double>(i));
        wide_m[j] = std::max(wide_m[j], widths_m[i] + std::sqrt(std::max(by_m * by_m - along_m * along_m, 0.0)));
      }
    }
  };
  widen(left_m_, margin_m, wide_left_m_);
  widen(right_m_, margin_m, wide_right_m_);
  if (decision_.policy == SafetyPolicy::kUpdated) {
    widen(left_m_, margins_.floor_m, floor_left_m_);
    widen(right_m_, margins_.floor_m, floor_right_m_);
    shrink(wide_left_m_, 1.0, floor_left_m_);
    shrink(wide_right_m_, -1.0, floor_right_m_);
  }
  polygon_world_m.clear();
  const auto is_in = [&](std::size_t j) { return wide_left_m_[j] + wide_right_m_[j] > 0.0; };  // false for -infinity
  for (std::size_t j = 0; j < count; ++j) {
    if (is_in(j)) polygon_world_m.emplace_back(frames_[j].to_world({0.0, -wide_right_m_[j]}));
  }
  for (std::size_t j = count; j-- > 0;) {
    if (is_in(j)) polygon_world_m.emplace_back(frames_[j].to_world({0.0, wide_left_m_[j]}));
  }
}

/// Widths on one side (1: left, -1: right) up to the known chains there, but never less than those of the hard floor.
void SafetyAreas::shrink(std::vector<double>& widths_m, double side, const std::vector<double>& least_m) const {
  for (const Edge& edge : edges_) {
    if (edge.weight != Weight::kKnown || !edge.explains) continue;
    for (std::size_t j = 0; j < frames_.size(); ++j) {
      if (widths_m[j] == -kNoLimit) continue;
      // Of the edge, the part beside this frame: at most half a step ahead and behind.
      const Eigen::Vector2d from_m = frames_[j].to_base(edge.from_m), to_m = frames_[j].to_base(edge.to_m);
      const double ahead_m = to_m.x() - from_m.x();
      double low = 0.0, high = 1.0;
      if (std::abs(ahead_m) < 1e-9) {
        if (std::abs(from_m.x()) > 0.5 * kStep_m) continue;
      } else {
        const double a = (-0.5 * kStep_m - from_m.x()) / ahead_m, b = (0.5 * kStep_m - from_m.x()) / ahead_m;
        low = std::max(low, std::min(a, b));
        high = std::min(high, std::max(a, b));
        if (low > high) continue;
      }
      const double y1_m = side * (from_m.y() + low * (to_m.y() - from_m.y()));
      const double y2_m = side * (from_m.y() + high * (to_m.y() - from_m.y()));
      const double nearest_m = std::min(y1_m, y2_m);
      if (std::max(y1_m, y2_m) < 0.0) continue;  // on the other side
      const double floor_m = std::max(least_m[j], 0.0);
      widths_m[j] = std::max(std::min(widths_m[j], nearest_m - edge.reach_m), floor_m);
    }
  }
}

}  // namespace situation_awareness

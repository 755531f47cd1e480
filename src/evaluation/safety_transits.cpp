// SPDX-License-Identifier: BSD-3-Clause
#include "situation_awareness/evaluation/safety_transits.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <deque>
#include <limits>

#include "situation_awareness/common/time.hpp"
#include "situation_awareness/geometry/angles.hpp"
#include "situation_awareness/geometry/box.hpp"
#include "situation_awareness/geometry/lie_groups.hpp"
#include "situation_awareness/geometry/simplify.hpp"
#include "walker_motion.hpp"

namespace situation_awareness {
namespace {

constexpr int kBeams = 541;
constexpr double kFirst_rad = radians(-135.0), kBeam_rad = radians(0.5);
constexpr double kRangeMax_m = 20.0;
constexpr int kTicksPerScan = 4;
constexpr double kRemoval_s = 0.8;  // until a map forgets what the scanner sees through
constexpr std::uint64_t kSeedsOfATurn = 10'000;
constexpr double kViewStep_m = 0.02;  // of vehicle and walker, where it is looked whether one sees the other
constexpr std::int64_t kBegin_ns = 1000 * kNanosecondsPerSecond;

struct CastEdge {
  Eigen::Vector2d from_m, to_m;
};

void add_edges(const Box& box, std::vector<CastEdge>& edges) {
  const auto c = corners(box);
  for (std::size_t i = 0; i < 4; ++i) edges.push_back({c[i], c[(i + 1) % 4]});
}

double cast_edges(const std::vector<CastEdge>& edges, const Eigen::Vector2d& from_m, const Eigen::Vector2d& u) {
  double range_m = std::numeric_limits<double>::infinity();
  for (const CastEdge& edge : edges) {
    const Eigen::Vector2d d = edge.to_m - edge.from_m, f = edge.from_m - from_m;
    const double determinant = d.x() * u.y() - d.y() * u.x();
    if (std::abs(determinant) < 1e-12) continue;
    const double r = (f.y() * d.x() - f.x() * d.y()) / determinant;
    const double s = (u.x() * f.y() - u.y() * f.x()) / determinant;
    if (r > 0.0 && s >= 0.0 && s <= 1.0) range_m = std::min(range_m, r);
  }
  return range_m;
}

/// What has stood there for long, along these places.
Feature known_outline(FeatureId id, const std::vector<Eigen::Vector2d>& places_m, bool closed) {
  PolylineShape outline;
  outline.closed = closed;
  for (const Eigen::Vector2d& place_m : places_m) outline.vertices.push_back({place_m, 0.005});
  Feature feature;
  feature.id = id;
  feature.p_exists = 0.99;
  feature.motion = Motion::kFixed;
  feature.shape = outline;
  return feature;
}

/// What the map has, and by what the areas are updated.
struct Senses {
  Map map;  ///< the person, where it has one, is the last feature
  VehicleState vehicle;
  std::vector<float> ranges_m;
};

constexpr FeatureId kWrongWall = 1000, kPerson = 2000;

Map map_of(const TransitScene& scene) {
  Map map;
  map.stamp_ns = kBegin_ns;
  FeatureId id = 1;
  for (const double side : {-1.0, 1.0}) {
    const double y_m = side * scene.half_width_m;
    map.features.push_back(known_outline(id++, {{-3.0, y_m}, {scene.length_m + 3.0, y_m}}, false));
  }
  for (const double x_m : {-3.0, scene.length_m + 3.0}) {
    map.features.push_back(known_outline(id++, {{x_m, -scene.half_width_m}, {x_m, scene.half_width_m}}, false));
  }
  for (const Box& box : scene.known_boxes) {
    const auto places_m = corners(box);
    map.features.push_back(known_outline(id++, {places_m.begin(), places_m.end()}, true));
  }
  return map;
}

Points scan_of(const Pose2& T_world_lidar, std::int64_t stamp_ns, const std::vector<CastEdge>& edges,
               const std::optional<WalkerMotion>& walker, const TransitParams& params, Random& random, Points memory) {
  Points points = std::move(memory);
  points.stamp_ns = stamp_ns;
  points.T_world_level = T_world_lidar;
  points.resolution_rad = kBeam_rad;
  points.points.clear();
  const Eigen::Matrix2d R_world_level = T_world_lidar.rotation();
  for (int i = 0; i < kBeams; ++i) {
    Point point;
    point.beam = i;
    point.azimuth_rad = kFirst_rad + i * kBeam_rad;
    const Eigen::Vector2d u_level(std::cos(point.azimuth_rad), std::sin(point.azimuth_rad));
    const Eigen::Vector2d u = R_world_level * u_level;
    double range_m = cast_edges(edges, T_world_lidar.translation_m, u);
    if (walker) range_m = std::min(range_m, walker->cast(T_world_lidar.translation_m, u));
    const bool is_lost = random.uniform() < params.lost_share;
    range_m += params.range_sigma_m * random.normal();
    if (is_lost || !(range_m < kRangeMax_m)) {
      point.state = BeamState::kFree;
      point.range_m = kRangeMax_m;
    } else {
      point.state = BeamState::kHit;
      point.range_m = std::max(range_m, 0.02);
      point.p_level_m = point.range_m * u_level;
    }
    points.points.push_back(point);
  }
  return points;
}

bool overlaps(const Footprint& footprint, const Pose2& T_world_base, const std::vector<CastEdge>& edges) {
  const Pose2 T_base_world = inverse(T_world_base);
  for (const CastEdge& edge : edges) {
    for (int i = 0; i <= 20; ++i) {
      const Eigen::Vector2d p_m = edge.from_m + 0.05 * i * (edge.to_m - edge.from_m);
      if (clearance_m(footprint, T_base_world * p_m) == 0.0) return true;
    }
    for (const Eigen::Vector2d& corner : footprint.corners_m) {
      if (distance_from_segment_m(T_world_base * corner, edge.from_m, edge.to_m) < 1e-6) return true;
    }
  }
  return false;
}

}  // namespace

const char* name_of(TransitFault fault) {
  static constexpr std::array<const char*, kTransitFaults> kNames = {
      "none",          "no scan",        "frozen scan",    "late scan",     "no return",
      "NaN scan",      "no objects",     "frozen map",     "no map",        "wrong map",
      "no covariance", "NaN covariance", "inf covariance", "-1 covariance", "large covariance",
      "no odometry",   "NaN odometry",   "no pose",        "no verdict",    "crash"};
  return kNames.at(static_cast<std::size_t>(fault));
}

bool has_to_stop(TransitFault fault) {
  switch (fault) {
    case TransitFault::kNone:
    case TransitFault::kNoObjects:
    case TransitFault::kFrozenMap:
    case TransitFault::kNoMap:
    case TransitFault::kWrongMap:
    case TransitFault::kNoOdometry:
    case TransitFault::kNanOdometry:
      return false;
    default:
      return true;
  }
}

namespace {

/// A transit under way: the world, what is sensed of it, and who drives.
class Transit {
 public:
  Transit(const TransitScene& scene, const TransitParams& params, std::uint64_t seed)
      : scene_(scene),
        params_(params),
        random_(seed * 2 + 1),
        path_{false, {{{0.0, 0.0}, {}}, {{0.5 * scene.length_m, 0.0}, {}}, {{scene.length_m, 0.0}, {}}}},
        following_(path_, params.vehicle, params.path),
        areas_(path_, params.vehicle, params.safety) {
    following_.start();
    for (const double side : {-1.0, 1.0}) {
      edges_.push_back({{-3.0, side * scene.half_width_m}, {scene.length_m + 3.0, side * scene.half_width_m}});
    }
    for (const double x_m : {-3.0, scene.length_m + 3.0}) {
      edges_.push_back({{x_m, -scene.half_width_m}, {x_m, scene.half_width_m}});
    }
    for (const Box& box : scene.known_boxes) add_edges(box, edges_);
    for (const Box& box : scene.new_boxes) add_edges(box, edges_);
    senses_.map = map_of(scene);
    if (scene.walker) walker_.emplace(*scene.walker);
  }

  TransitOutcome run() {
    for (int tick = 0; tick * kTick_s < params_.longest_s; ++tick) {
      time_s_ = tick * kTick_s;
      outcome_.time_s = time_s_;
      if (tick % kTicksPerScan == 0) {
        command();
        if (outcome_.arrived) return outcome_;
      }
      move(tick);
      if (outcome_.found && has_to_stop(params_.fault) && stood_s_ > kStood_s) break;
    }
    outcome_.stands = stood_s_ > kStood_s;
    if (!outcome_.found || !has_to_stop(params_.fault)) outcome_.time_s = params_.longest_s;
    return outcome_;
  }

 private:
  static constexpr double kStood_s = 1.0;

  bool fails(TransitFault fault) const { return params_.fault == fault && time_s_ >= params_.fault_s; }
  bool has_failed() const { return params_.fault != TransitFault::kNone && time_s_ >= params_.fault_s; }

  /// What the map has of the scan before.
  void map_what_is_seen(std::int64_t stamp_ns) {
    if (fails(TransitFault::kNoMap)) return;
    Map& map = senses_.map;
    map.stamp_ns = stamp_ns;
    if (fails(TransitFault::kFrozenMap)) {
      map.objects_stamp_ns = stamp_ns;
      return;
    }
    const bool is_seen = !fails(TransitFault::kNoReturn) && !fails(TransitFault::kNanScan);
    std::optional<Feature> person;
    if (!map.features.empty() && map.features.back().id == kPerson) {
      person = map.features.back();
      map.features.pop_back();
    }
    for (Feature& feature : map.features) {
      if (is_seen) feature.last_seen_ns = stamp_ns;
    }
    const bool forgets = fails(TransitFault::kNoReturn) && time_s_ - params_.fault_s > kRemoval_s;
    if (forgets) map.features.clear();
    if (fails(TransitFault::kWrongMap) && !is_wrong_ && scene_.walker) {
      map.features.push_back(known_outline(kWrongWall, {scene_.walker->from_m, scene_.walker->to_m}, false));
      map.features.back().last_seen_ns = stamp_ns;
      is_wrong_ = true;
    }
    if (!fails(TransitFault::kNoObjects) && is_seen) person = person_on_map(stamp_ns);
    // A person that no scan sees any more is not known by it.
    if (!fails(TransitFault::kNoObjects) && (is_seen || !person)) map.objects_stamp_ns = stamp_ns;
    if (person) map.features.push_back(*person);
  }

  std::optional<Feature> person_on_map(std::int64_t stamp_ns) const {
    if (!walker_ || !sees_walker()) return std::nullopt;
    Feature person;
    person.id = kPerson;
    person.object_class = ObjectClass::kPerson;
    person.motion = Motion::kStanding;
    person.first_seen_ns = kBegin_ns;
    person.last_seen_ns = stamp_ns;
    EllipseShape shape{{walker_->center_m(), 0.0, 0.2, 0.2}, {}};
    shape.body.velocity_world_m_s = walker_velocity_m_s_;
    person.shape = shape;
    return person;
  }

  bool sees_walker() const {
    const Eigen::Vector2d to_m = walker_->center_m() - T_world_base_.translation_m;
    const double azimuth_rad = wrap_to_pi(std::atan2(to_m.y(), to_m.x()) - T_world_base_.yaw_rad);
    return std::abs(azimuth_rad) < -kFirst_rad &&
           cast_edges(edges_, T_world_base_.translation_m, to_m.normalized()) > to_m.norm();
  }

  VehicleState sensed_vehicle(std::int64_t stamp_ns) {
    VehicleState& state = senses_.vehicle;
    const double sigma_m = params_.pose_sigma_m, sigma_rad = params_.pose_sigma_rad;
    const Pose2 error{{sigma_m * random_.normal(), sigma_m * random_.normal()}, sigma_rad * random_.normal()};
    state.T_world_base = T_world_base_ * error;
    state.covariance_world.setZero();
    state.covariance_world.diagonal() << sigma_m * sigma_m, sigma_m * sigma_m, sigma_rad * sigma_rad;
    const double nan = std::numeric_limits<double>::quiet_NaN(), inf = std::numeric_limits<double>::infinity();
    if (fails(TransitFault::kNoCovariance) || fails(TransitFault::kNanCovariance)) {
      state.covariance_world.setConstant(nan);
    }
    if (fails(TransitFault::kInfCovariance)) state.covariance_world.diagonal().setConstant(inf);
    if (fails(TransitFault::kMinusCovariance)) state.covariance_world.diagonal().setConstant(-1.0);
    if (fails(TransitFault::kLargeCovariance)) state.covariance_world.diagonal().setConstant(1.0);
    const double speed_m_s = now_.speed_m_s * (1.0 + 0.01 * random_.normal());
    if (fails(TransitFault::kNoOdometry)) return state;
    state.speed_m_s = fails(TransitFault::kNanOdometry) ? nan : speed_m_s;
    state.speed_stamp_ns = stamp_ns;
    return state;
  }

  void scan(std::int64_t stamp_ns) {
    if (fails(TransitFault::kFrozenScan) && !points_.points.empty()) {
      points_.stamp_ns = stamp_ns;
      return;
    }
    points_ = scan_of(T_world_base_, stamp_ns, edges_, walker_, params_, random_, std::move(points_));
    senses_.ranges_m.clear();
    for (Point& point : points_.points) {
      if (fails(TransitFault::kNoReturn)) {
        point.state = BeamState::kFree;
        point.range_m = kRangeMax_m;
      }
      if (fails(TransitFault::kNanScan)) point.state = BeamState::kInvalid;
      senses_.ranges_m.push_back(point.state == BeamState::kHit ? static_cast<float>(point.range_m)
                                                                : std::numeric_limits<float>::infinity());
    }
  }

  /// One scan, the verdict, and the command by it, as the stages do it.
  void command() {
    const std::int64_t stamp_ns = kBegin_ns + nanoseconds(time_s_);
    const VehicleState& state = sensed_vehicle(stamp_ns);
    scan(stamp_ns);
    points_.T_world_level = state.T_world_base;
    map_what_is_seen(stamp_ns - nanoseconds(kTicksPerScan * kTick_s));
    const bool is_scanned = !fails(TransitFault::kNoScan) && !fails(TransitFault::kLateScan) &&
                            !fails(TransitFault::kNoVerdict) && !fails(TransitFault::kNoPose);
    bool is_named = false;
    if (is_scanned) {
      const SafetyDecision& decision = areas_.update(points_, state, senses_.map, senses_.ranges_m);
      allowed_ = {decision.allowed_speed_m_s, decision.may_turn};
      allowed_s_ = time_s_;
      using Kind = SafetyDecision::Kind;
      is_named = decision.verdict == SafetyDecision::Verdict::kStop &&
                 (decision.kind == Kind::kPose || decision.kind == Kind::kContradiction ||
                  decision.kind == Kind::kFrozenScan || decision.kind == Kind::kHidden);
    }
    const bool is_commanded = !fails(TransitFault::kCrash);
    const bool is_fresh = allowed_s_ >= 0.0 && time_s_ - allowed_s_ <= params_.path.timeout_s;
    if (is_commanded) {
      const PathFollowingResult& result = is_fresh && !fails(TransitFault::kNoPose)
                                              ? following_.update(stamp_ns, state.T_world_base, allowed_)
                                              : following_.brake(stamp_ns);
      const double latency_s = params_.sweep_s + random_.uniform(params_.least_latency_s, params_.most_latency_s);
      commands_.emplace_back(time_s_ + latency_s, result.command);
      outcome_.arrived = result.state == PathFollowingResult::State::kArrived;
      commanded_s_ = time_s_ + latency_s;
    }
    const bool is_dead = !is_commanded && time_s_ - commanded_s_ >= params_.watchdog_s;
    if (has_failed() && !outcome_.found && (is_named || !is_fresh || is_dead || fails(TransitFault::kNoPose))) {
      outcome_.found = true;
      outcome_.found_after_s = time_s_ - params_.fault_s;
      outcome_.found_speed_m_s = now_.speed_m_s;
    }
  }

  void move(int tick) {
    while (!commands_.empty() && commands_.front().first <= time_s_) {
      now_ = commands_.front().second;
      commands_.pop_front();
    }
    if (fails(TransitFault::kCrash) && commands_.empty() && time_s_ - commanded_s_ > params_.watchdog_s) {
      now_.speed_m_s = std::max(now_.speed_m_s - params_.vehicle.braking_m_s2 * kTick_s, 0.0);
      now_.turn_rate_rad_s = 0.0;
    }
    T_world_base_ = T_world_base_ * exp_se2(kTick_s * Eigen::Vector3d(now_.speed_m_s, 0.0, now_.turn_rate_rad_s));
    const bool moves = now_.speed_m_s > kMoving_m_s || std::abs(now_.turn_rate_rad_s) > 1e-2;
    stood_s_ = moves ? 0.0 : stood_s_ + kTick_s;
    if (outcome_.found) outcome_.way_to_stand_m += now_.speed_m_s * kTick_s;
    if (time_s_ > 2.0 && T_world_base_.translation_m.x() < scene_.length_m - 0.5) {
      outcome_.least_speed_m_s = std::min(outcome_.least_speed_m_s, now_.speed_m_s);
    }
    if (walker_) meet_walker(moves);
    if (tick % 10 == 0 && overlaps(params_.vehicle.footprint, T_world_base_, edges_)) outcome_.hit_box = true;
  }

  void meet_walker(bool moves) {
    const Eigen::Vector2d before_m = walker_->center_m();
    walker_->advance(time_s_, T_world_base_, now_.speed_m_s, params_.vehicle.footprint);
    walker_velocity_m_s_ = (walker_->center_m() - before_m) / kTick_s;
    in_view_s_ = sees_walker() ? in_view_s_ + kTick_s : 0.0;
    if (!moves) return;
    const double gap_m = clearance_m(params_.vehicle.footprint, inverse(T_world_base_) * walker_->center_m());
    outcome_.least_clearance_m = std::min(outcome_.least_clearance_m, gap_m - Walker::kRadius_m);
    if (gap_m > Walker::kRadius_m || outcome_.touched) return;
    outcome_.touched = true;
    outcome_.touch_speed_m_s = now_.speed_m_s;
    outcome_.touch_in_view_s = in_view_s_;
  }

  const TransitScene& scene_;
  const TransitParams& params_;
  Random random_;
  Path path_;
  PathFollowing following_;
  SafetyAreas areas_;
  std::vector<CastEdge> edges_;
  std::optional<WalkerMotion> walker_;
  Eigen::Vector2d walker_velocity_m_s_ = Eigen::Vector2d::Zero();
  double in_view_s_ = 0.0;
  Senses senses_;
  bool is_wrong_ = false;
  Points points_;
  AllowedMotion allowed_;
  double allowed_s_ = -1.0;  ///< when; -1: never
  double commanded_s_ = 0.0;
  double time_s_ = 0.0, stood_s_ = 0.0;
  Pose2 T_world_base_;
  Velocity now_;
  std::deque<std::pair<double, Velocity>> commands_;  // and when the vehicle obeys
  TransitOutcome outcome_;
};

}  // namespace

TransitOutcome simulate_transit(const TransitScene& scene, const TransitParams& params, std::uint64_t seed) {
  return Transit(scene, params, seed).run();
}

double longest_way_to_stand_m(const TransitOutcome& outcome, const TransitParams& params) {
  const VehicleParams& vehicle = params.vehicle;
  const double faster_m_s = vehicle.acceleration_m_s2 * (vehicle.reaction_s + kTicksPerScan * kTick_s);
  const double v = std::min(outcome.found_speed_m_s + faster_m_s, vehicle.max_speed_m_s);
  return v * vehicle.reaction_s + 0.5 * v * v / vehicle.braking_m_s2 + 0.01;
}

TransitScene scene_with_boxes(std::uint64_t seed) {
  Random random(seed * 7 + 3);
  TransitScene scene;
  for (const double x_m : {3.0, 6.0, 9.0}) {
    const double side = random.uniform() < 0.5 ? -1.0 : 1.0;
    const Box size{{0.0, 0.0}, random.uniform(-0.3, 0.3), random.uniform(0.2, 0.4), random.uniform(0.15, 0.3)};
    double reach_m = 0.0;
    for (const Eigen::Vector2d& corner : corners(size)) reach_m = std::max(reach_m, corner.y());
    Box box = size;
    // From 0.2 m to 0.45 m beside the vehicle.
    box.center_m = {x_m + random.uniform(-0.5, 0.5), side * (0.19 + random.uniform(0.2, 0.45) + reach_m)};
    scene.known_boxes.push_back(box);
  }
  return scene;
}

namespace {

/// Someone who steps into the way from a side, beside a known box or not, or from behind one.
TransitScene draw_walker(Random& random, bool behind_a_box) {
  TransitScene scene;
  scene.length_m = 6.0;
  Walker walker;
  const double side = random.uniform() < 0.5 ? -1.0 : 1.0;
  const double crossing_m = random.uniform(1.5, 4.5);
  const double slant_rad = behind_a_box ? 0.0 : random.uniform(radians(-35.0), radians(35.0));
  const double start_m = behind_a_box ? 1.35 : random.uniform(1.1, 1.4);
  walker.from_m = {crossing_m + start_m * std::tan(slant_rad), side * start_m};
  walker.to_m = {crossing_m - 1.4 * std::tan(slant_rad), -side * 1.4};
  walker.speed_m_s = random.uniform(0.5, 2.0);
  // So that it is in the way about when the vehicle is there, which starts at 0.3 m/s^2 and drives 0.5 m/s.
  const double vehicle_s = crossing_m / 0.5 + 0.5 * 0.5 / 0.3;
  walker.begin_s = std::max(0.0, vehicle_s + random.uniform(-2.5, 1.0) - start_m / walker.speed_m_s);
  if (random.uniform() < 0.25) {
    walker.pause_at_m = random.uniform(0.3, 2.0);
    walker.pause_s = random.uniform(0.5, 4.0);
  }
  if (random.uniform() < 0.5 || behind_a_box) {
    // A known box that the walker, or the vehicle, passes.
    const double box_x_m = behind_a_box ? crossing_m - 0.55 : crossing_m + (random.uniform() < 0.5 ? -1.2 : 1.2);
    scene.known_boxes.push_back({{box_x_m, side * 0.85}, 0.0, 0.3, 0.25});
  }
  scene.walker = walker;
  return scene;
}

/// Whether a walker is in view wherever the vehicle is, unless they could not touch it within the time in which it
/// stands from its full speed, however it drives and they walk meanwhile.
bool is_in_view_in_time(const TransitScene& scene, const VehicleParams& vehicle) {
  std::vector<CastEdge> edges;
  for (const Box& box : scene.known_boxes) add_edges(box, edges);
  if (edges.empty()) return true;
  const Walker& walker = *scene.walker;
  const double way_m = (walker.to_m - walker.from_m).norm();
  const double stand_s = longest_time_to_stand_s(vehicle);
  const auto pieces = [](double length_m) { return static_cast<int>(std::ceil(length_m / kViewStep_m)); };
  const int places = pieces(scene.length_m), steps = pieces(way_m);
  const auto place_m = [&](int i) { return Eigen::Vector2d(scene.length_m * i / places, 0.0); };
  const auto walker_m = [&](int k) {
    return Eigen::Vector2d(walker.from_m + (walker.to_m - walker.from_m) * (static_cast<double>(k) / steps));
  };
  // From each place of the vehicle the steps at which it is touched: one interval, as the footprint is convex.
  std::vector<std::pair<int, int>> touching(static_cast<std::size_t>(places) + 1, {steps, 0});
  for (int i = 0; i <= places; ++i) {
    auto& [first, last] = touching[static_cast<std::size_t>(i)];
    for (int k = 0; k <= steps; ++k) {
      if (clearance_m(vehicle.footprint, walker_m(k) - place_m(i)) > Walker::kRadius_m + kViewStep_m) continue;
      first = std::min(first, k);
      last = k;
    }
  }
  const int ahead = pieces(vehicle.max_speed_m_s * stand_s), around = pieces(walker.speed_m_s * stand_s);
  for (int i = 0; i <= places; ++i) {
    int first = steps, last = 0;
    for (int j = i; j <= std::min(i + ahead, places); ++j) {
      first = std::min(first, touching[static_cast<std::size_t>(j)].first);
      last = std::max(last, touching[static_cast<std::size_t>(j)].second);
    }
    if (first > last) continue;
    for (int k = std::max(first - around, 0); k <= std::min(last + around, steps); ++k) {
      const Eigen::Vector2d to_m = walker_m(k) - place_m(i);
      if (cast_edges(edges, place_m(i), to_m.normalized()) < to_m.norm()) return false;
    }
  }
  return true;
}

}  // namespace

double longest_time_to_stand_s(const VehicleParams& vehicle) {
  return vehicle.reaction_s + vehicle.max_speed_m_s / vehicle.braking_m_s2;
}

TransitScene scene_with_walker(std::uint64_t seed, const VehicleParams& vehicle,
                               std::vector<TransitScene>* out_of_hiding) {
  Random random(seed * 13 + 5);
  for (;;) {
    TransitScene scene = draw_walker(random, false);
    if (is_in_view_in_time(scene, vehicle)) return scene;
    if (out_of_hiding != nullptr) out_of_hiding->push_back(std::move(scene));
  }
}

TransitScene scene_with_walker_behind_a_box(std::uint64_t seed) {
  Random random(seed * 13 + 5);
  return draw_walker(random, true);
}

TransitScene scene_with_box_at_the_end(std::uint64_t seed) {
  Random random(seed * 17 + 7);
  TransitScene scene;
  scene.length_m = 3.0;
  const double side = random.uniform() < 0.5 ? -1.0 : 1.0;
  // Beside the end or behind it, so that it is passed, and within reach of a tail that turns.
  scene.known_boxes.push_back({{scene.length_m + random.uniform(-0.7, 0.5), side * random.uniform(0.4, 0.75)},
                               random.uniform(-kPi, kPi),
                               random.uniform(0.05, 0.15),
                               random.uniform(0.05, 0.1)});
  return scene;
}

Footprint footprint_of_shape(std::size_t shape) {
  if (shape == 1) return {{{0.2, 0.2}, {-0.6, 0.2}, {-0.6, -0.2}, {0.2, -0.2}}};
  if (shape == 2) return {{{0.6, 0.3}, {0.5, 0.35}, {-0.5, 0.35}, {-0.5, -0.35}, {0.5, -0.35}, {0.6, -0.3}}};
  return VehicleParams().footprint;
}

TransitWithFault transit_with_fault(SafetyPolicy policy, std::uint64_t seed) {
  Random random(seed * 19 + 11);
  TransitWithFault run;
  run.params.safety.policy = policy;
  run.params.vehicle.footprint = footprint_of_shape((seed + (seed - 1) / kSeedsOfATurn) % kShapes);
  run.scene = scene_with_walker(seed, run.params.vehicle, &run.out_of_hiding);
  run.params.fault = static_cast<TransitFault>(1 + static_cast<int>(random.uniform(0.0, kTransitFaults - 1.0 - 1e-9)));
  run.params.fault_s = random.uniform() < 0.1 ? 0.0 : random.uniform(0.0, 14.0);
  run.params.longest_s = 40.0;
  return run;
}

}  // namespace situation_awareness

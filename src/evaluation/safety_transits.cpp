// SPDX-License-Identifier: BSD-3-Clause
#include "situation_awareness/evaluation/safety_transits.hpp"

#include <algorithm>
#include <cmath>
#include <deque>
#include <limits>

#include "situation_awareness/common/time.hpp"
#include "situation_awareness/geometry/angles.hpp"
#include "situation_awareness/geometry/box.hpp"
#include "situation_awareness/geometry/lie_groups.hpp"
#include "situation_awareness/geometry/simplify.hpp"

namespace situation_awareness {
namespace {

constexpr int kBeams = 541;
constexpr double kFirst_rad = radians(-135.0), kBeam_rad = radians(0.5);
constexpr double kRangeMax_m = 20.0;
constexpr double kTick_s = 0.01;
constexpr int kTicksPerScan = 4;
constexpr double kMoving_m_s = 0.001;
constexpr double kStride_m = 0.12;  // of a leg, ahead and behind
constexpr double kHips_m = 0.08;    // of a leg, to the side
constexpr double kBlocked_s = 1.0;  // a walker in front of a vehicle that stands waits so long, and goes back
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

double cast_circle(const Eigen::Vector2d& center_m, double radius_m, const Eigen::Vector2d& from_m,
                   const Eigen::Vector2d& u) {
  const Eigen::Vector2d to_m = center_m - from_m;
  const double along_m = u.dot(to_m), across_m = u.x() * to_m.y() - u.y() * to_m.x();
  const double half2_m2 = radius_m * radius_m - across_m * across_m;
  if (half2_m2 <= 0.0 || along_m <= 0.0) return std::numeric_limits<double>::infinity();
  return along_m - std::sqrt(half2_m2);
}

/// Where a walker is, who goes back where a vehicle that stands is in the way.
class WalkerMotion {
 public:
  explicit WalkerMotion(const Walker& walker) : walker_(walker), pause_left_s_(walker.pause_s) {}

  Eigen::Vector2d center_m() const { return walker_.from_m + way_m_ * direction(); }

  void advance(double time_s, const Pose2& T_world_base, double vehicle_m_s, const Footprint& footprint) {
    if (time_s < walker_.begin_s) return;
    if (waits_s_ > 0.0) {
      waits_s_ -= kTick_s;
      if (waits_s_ <= 0.0) goes_back_ = true;
      return;
    }
    if (way_m_ >= walker_.pause_at_m && pause_left_s_ > 0.0 && !goes_back_) {
      pause_left_s_ -= kTick_s;
      return;
    }
    const double length_m = (walker_.to_m - walker_.from_m).norm();
    const double step_m = walker_.speed_m_s * kTick_s;
    const double next_m = std::clamp(way_m_ + (goes_back_ ? -step_m : step_m), 0.0, length_m);
    const Eigen::Vector2d p_base_m = inverse(T_world_base) * (walker_.from_m + next_m * direction());
    const bool is_blocked = clearance_m(footprint, p_base_m) <= Walker::kRadius_m + 0.01;
    if (is_blocked && std::abs(vehicle_m_s) <= kMoving_m_s) {
      if (!goes_back_) waits_s_ = kBlocked_s;
      return;
    }
    way_m_ = next_m;
  }

  double cast(const Eigen::Vector2d& from_m, const Eigen::Vector2d& u) const {
    const Eigen::Vector2d ahead = direction(), aside(-ahead.y(), ahead.x());
    const double stride_m = kStride_m * std::sin(way_m_ * kPi / 0.7);
    double range_m = std::numeric_limits<double>::infinity();
    for (const double leg : {-1.0, 1.0}) {
      const Eigen::Vector2d leg_m = center_m() + leg * (stride_m * ahead + kHips_m * aside);
      range_m = std::min(range_m, cast_circle(leg_m, Walker::kLegRadius_m, from_m, u));
    }
    return range_m;
  }

 private:
  Eigen::Vector2d direction() const { return (walker_.to_m - walker_.from_m).normalized(); }

  Walker walker_;
  double way_m_ = 0.0;
  double pause_left_s_ = 0.0;
  double waits_s_ = 0.0;
  bool goes_back_ = false;
};

Chain chain_of(const Box& box, std::uint64_t id) {
  Chain chain;
  chain.id = id;
  chain.closed = true;
  for (const Eigen::Vector2d& corner : corners(box)) chain.vertices.push_back({corner, 0.005});
  chain.state = ChainState::kKnown;
  chain.p_exists = 0.99;
  return chain;
}

Polygons map_of(const TransitScene& scene) {
  Polygons map;
  map.stamp_ns = kBegin_ns;
  std::uint64_t id = 1;
  for (const double side : {-1.0, 1.0}) {
    Chain wall;
    wall.id = id++;
    wall.vertices = {{{-3.0, side * scene.half_width_m}, 0.005},
                     {{scene.length_m + 3.0, side * scene.half_width_m}, 0.005}};
    wall.state = ChainState::kWall;
    wall.p_exists = 0.99;
    map.chains.push_back(wall);
  }
  for (const Box& box : scene.known_boxes) map.chains.push_back(chain_of(box, id++));
  return map;
}

Points scan_of(const Pose2& T_world_lidar, std::int64_t stamp_ns, const std::vector<CastEdge>& edges,
               const std::optional<WalkerMotion>& walker, const TransitParams& params, Random& random, Points memory) {
  Points points = std::move(memory);
  points.stamp_ns = stamp_ns;
  points.T_world_level = T_world_lidar;
  points.resolution_rad = kBeam_rad;
  points.points.clear();
  for (int i = 0; i < kBeams; ++i) {
    Point point;
    point.beam = i;
    point.azimuth_rad = kFirst_rad + i * kBeam_rad;
    const Eigen::Vector2d u_level(std::cos(point.azimuth_rad), std::sin(point.azimuth_rad));
    const Eigen::Vector2d u = Eigen::Rotation2Dd(T_world_lidar.yaw_rad) * u_level;
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

TransitOutcome simulate_transit(const TransitScene& scene, const TransitParams& params, std::uint64_t seed) {
  Random random(seed * 2 + 1);
  const Path path{false, {{{0.0, 0.0}, {}}, {{0.5 * scene.length_m, 0.0}, {}}, {{scene.length_m, 0.0}, {}}}};
  PathFollowing following(path, params.vehicle, params.path);
  SafetyAreas areas(path, params.vehicle, params.safety);
  following.start();

  std::vector<CastEdge> edges;
  for (const double side : {-1.0, 1.0}) {
    edges.push_back({{-3.0, side * scene.half_width_m}, {scene.length_m + 3.0, side * scene.half_width_m}});
  }
  for (const double x_m : {-3.0, scene.length_m + 3.0}) {
    edges.push_back({{x_m, -scene.half_width_m}, {x_m, scene.half_width_m}});
  }
  for (const Box& box : scene.known_boxes) add_edges(box, edges);
  for (const Box& box : scene.new_boxes) add_edges(box, edges);
  const Polygons map = map_of(scene);
  std::optional<WalkerMotion> walker;
  if (scene.walker) walker.emplace(*scene.walker);

  TransitOutcome outcome;
  Pose2 T_world_base;
  Velocity now;
  std::deque<std::pair<double, Velocity>> commands;  // and when the vehicle obeys
  Points points;
  VehicleState state;
  const double sigma_m = params.pose_sigma_m, sigma_rad = params.pose_sigma_rad;
  state.covariance_world.diagonal() << sigma_m * sigma_m, sigma_m * sigma_m, sigma_rad * sigma_rad;
  for (int tick = 0; tick * kTick_s < params.longest_s; ++tick) {
    const double time_s = tick * kTick_s;
    if (tick % kTicksPerScan == 0) {
      const std::int64_t stamp_ns = kBegin_ns + nanoseconds(time_s);
      const Pose2 error{{sigma_m * random.normal(), sigma_m * random.normal()}, sigma_rad * random.normal()};
      state.T_world_base = T_world_base * error;
      state.speed_m_s = now.speed_m_s * (1.0 + 0.01 * random.normal());
      points = scan_of(T_world_base, stamp_ns, edges, walker, params, random, std::move(points));
      points.T_world_level = state.T_world_base;
      const SafetyDecision& decision = areas.update(points, state, map, {});
      const PathFollowingResult& result =
          following.update(stamp_ns, state.T_world_base, {decision.allowed_speed_m_s, decision.may_turn});
      const double latency_s = params.sweep_s + random.uniform(params.least_latency_s, params.most_latency_s);
      commands.emplace_back(time_s + latency_s, result.command);
      if (result.state == PathFollowingResult::State::kArrived) {
        outcome.arrived = true;
        outcome.time_s = time_s;
        return outcome;
      }
    }
    while (!commands.empty() && commands.front().first <= time_s) {
      now = commands.front().second;
      commands.pop_front();
    }
    T_world_base = T_world_base * exp_se2(kTick_s * Eigen::Vector3d(now.speed_m_s, 0.0, now.turn_rate_rad_s));
    if (time_s > 2.0 && T_world_base.translation_m.x() < scene.length_m - 0.5) {
      outcome.least_speed_m_s = std::min(outcome.least_speed_m_s, now.speed_m_s);
    }
    if (walker) {
      walker->advance(time_s, T_world_base, now.speed_m_s, params.vehicle.footprint);
      const double gap_m = clearance_m(params.vehicle.footprint, inverse(T_world_base) * walker->center_m());
      const bool moves = now.speed_m_s > kMoving_m_s || std::abs(now.turn_rate_rad_s) > 1e-2;
      if (moves) {
        outcome.least_clearance_m = std::min(outcome.least_clearance_m, gap_m - Walker::kRadius_m);
        if (gap_m <= Walker::kRadius_m && !outcome.touched) {
          outcome.touched = true;
          outcome.touch_speed_m_s = now.speed_m_s;
        }
      }
    }
    if (tick % 10 == 0 && overlaps(params.vehicle.footprint, T_world_base, edges)) outcome.hit_box = true;
  }
  outcome.time_s = params.longest_s;
  return outcome;
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

TransitScene scene_with_walker(std::uint64_t seed, bool behind_a_box) {
  Random random(seed * 13 + 5);
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

}  // namespace situation_awareness

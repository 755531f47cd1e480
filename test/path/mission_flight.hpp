// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <functional>
#include <limits>
#include <string>
#include <vector>

#include "path/obstacle_scene.hpp"
#include "situation_awareness/common/params_yaml.hpp"
#include "situation_awareness/common/random.hpp"
#include "situation_awareness/geometry/vectors.hpp"
#include "situation_awareness/path/circumnavigation.hpp"
#include "situation_awareness/pipeline/map_pipeline.hpp"
#include "support/thread_cpu.hpp"

namespace situation_awareness {

using Outline = std::vector<Eigen::Vector2d>;

inline double distance_to(const Outline& outline, const Eigen::Vector2d& p_m) {
  double least_m = std::numeric_limits<double>::infinity();
  for (std::size_t i = 0; i < outline.size(); ++i) {
    const Eigen::Vector2d way_m = outline[(i + 1) % outline.size()] - outline[i];
    const double part = std::clamp(way_m.dot(p_m - outline[i]) / way_m.squaredNorm(), 0.0, 1.0);
    least_m = std::min(least_m, (outline[i] + part * way_m - p_m).norm());
  }
  return least_m;
}

inline bool is_inside(const Outline& outline, const Eigen::Vector2d& p_m) {
  bool inside = false;
  for (std::size_t i = 0; i < outline.size(); ++i) {
    const Eigen::Vector2d& a = outline[i];
    const Eigen::Vector2d& b = outline[(i + 1) % outline.size()];
    if ((a.y() > p_m.y()) != (b.y() > p_m.y()) && (cross(b - a, p_m - a) > 0.0) == (b.y() > a.y())) inside = !inside;
  }
  return inside;
}

inline double distance_to(const Outline& a, const Outline& b) {
  double least_m = std::numeric_limits<double>::infinity();
  for (const Eigen::Vector2d& p : a) least_m = std::min(least_m, distance_to(b, p));
  for (const Eigen::Vector2d& p : b) least_m = std::min(least_m, distance_to(a, p));
  return least_m;
}

inline Eigen::Vector2d middle_of(const Outline& outline) {
  Eigen::Vector2d sum_m = Eigen::Vector2d::Zero();
  for (const Eigen::Vector2d& p : outline) sum_m += p;
  return sum_m / static_cast<double>(outline.size());
}

/// One to `most` obstacles of any shape within 45 m, 3 m apart at least; half of them hardly more.
inline std::vector<Outline> random_towers(Random& random, int most) {
  std::vector<Outline> towers;
  const auto count = static_cast<std::size_t>(1.0 + random.uniform(0.0, most));
  for (int trial = 0; towers.size() < count && trial < 10'000; ++trial) {
    const auto shape = static_cast<TowerShape>(static_cast<int>(random.uniform(0.0, 5.0)));
    const Pose2 T{{random.uniform(-35.0, 35.0), random.uniform(-35.0, 35.0)}, random.uniform(-kPi, kPi)};
    const Outline outline = placed(T, tower(shape));
    double gap_m = std::numeric_limits<double>::infinity();
    for (const Outline& other : towers) {
      gap_m = is_inside(other, T.translation_m) ? 0.0 : std::min(gap_m, distance_to(outline, other));
    }
    const bool near = towers.size() % 2 == 1 && trial < 5'000;
    if (gap_m < 3.0 || (near && gap_m > 6.0)) continue;
    towers.push_back(outline);
  }
  return towers;
}

/// What a flight was like.
struct MissionFlight {
  bool ended = false;
  double least_clearance_m = std::numeric_limits<double>::infinity();
  double greatest_1_m = 0.0;       ///< curvature through the air
  double greatest_path_1_m = 0.0;  ///< of the paths
  double greatest_error_m = 0.0;   ///< across the path
  double time_s = 0.0, held_s = 0.0;
  double laps = 0.0;  ///< around an obstacle until its boundary was done, the greatest
  int closed = 0, towers = 0, given_up = 0;
  int around = 0;               ///< towers whose boundary is closed, or around which it flew nine tenths of a turn
  std::vector<double> step_us;  ///< of the processor, each step
  std::string reason;
};

constexpr double kMissionSpeed_m_s = 5.0;  ///< through the air
constexpr double kMissionLag_s = 0.15;     ///< of the turn rate

struct MissionFlightParams {
  double wind_m_s = 0.6, gust_m_s = 0.2;
  double pose_sigma_m = 0.1, yaw_sigma_rad = 0.005;
  double range_sigma_m = 0.03;
  int beams = 541;            ///< of 270 degrees
  int scan_every = 2;         ///< steps of 50 ms from scan to scan
  double longest_s = 1500.0;  ///< of the flight
  bool is_mapped = true;      ///< else the map has nothing on it, and is of now
  CircumnavigationParams mission;
  MapPipelineParams map;
  ObjectPipelineParams objects;
  MapKinds kinds{false, true, true, false};

  MissionFlightParams() {
    mission.following.airspeed_m_s = kMissionSpeed_m_s;
    mission.following.reaction_s = kMissionLag_s;
  }
};

/// With the map as it is shipped, of all kinds.
inline MissionFlightParams shipped_mission_flight() {
  const std::string source = SITUATION_AWARENESS_SOURCE_DIR, path = source + "/cfg/map_outdoor.yaml";
  MissionFlightParams params;
  params.map = params_from_yaml<MapPipelineParams>(read_text_file(path), path, [](const UnknownKey&) {});
  params.objects = load_object_pipeline_params(path, source + "/models", [](const UnknownKey&) {});
  params.kinds.objects = true;
  return params;
}

/// A vehicle that flies on at 5 m/s through the air, turns on 6 m at least and sees 270 degrees and 30 m ahead, among
/// obstacles of which it knows nothing.
class MissionSimulation {
 public:
  static constexpr double kCurvature_1_m = 1.0 / 6.0, kReach_m = 30.0, kControl_s = 0.05;

  MissionSimulation(std::vector<Outline> towers, const MissionFlightParams& params, std::uint64_t seed)
      : params_(params), towers_(std::move(towers)), random_(seed) {
    const double from_rad = random_.uniform(-kPi, kPi);
    wind_ = params_.wind_m_s * Eigen::Vector2d(std::cos(from_rad), std::sin(from_rad));
    scan_.angle_min_rad = radians(-135.0);
    scan_.angle_increment_rad = radians(270.0) / (params_.beams - 1);
  }

  MissionFlight fly(const Pose2& start, const std::vector<DubinsEnd>& search) {
    MissionFlight flight;
    flight.towers = static_cast<int>(towers_.size());
    turned_rad_.assign(towers_.size(), 0.0);
    Circumnavigation mission(params_.mission, search);
    MapPipeline pipeline(params_.map, params_.objects, params_.kinds);
    Eigen::Vector2d p_m = start.translation_m, error_m = Eigen::Vector2d::Zero();
    double heading_rad = start.yaw_rad, curvature_1_m = 0.0, told_1_m = 0.0;
    Eigen::Vector2d velocity(kMissionSpeed_m_s * std::cos(heading_rad), kMissionSpeed_m_s * std::sin(heading_rad));
    for (int i = 0; i * kControl_s < params_.longest_s; ++i) {
      const double t_s = i * kControl_s;
      flight.time_s = t_s;
      if (i % 2 == 0) {
        // Errors of the position wander within 10 s.
        const double keep = std::exp(-2.0 * kControl_s / 10.0);
        error_m = keep * error_m + std::sqrt(1.0 - keep * keep) * params_.pose_sigma_m *
                                       Eigen::Vector2d(random_.normal(), random_.normal());
        const double yaw_error_rad = params_.yaw_sigma_rad * random_.normal();
        MissionInput input;
        input.stamp_ns = 1'000'000'000'000 + static_cast<std::int64_t>(i) * 50'000'000;
        input.T_world_base = {p_m + error_m, std::atan2(velocity.y(), velocity.x()) + yaw_error_rad};
        input.covariance_world = Eigen::Vector3d(params_.pose_sigma_m, params_.pose_sigma_m, params_.yaw_sigma_rad)
                                     .array()
                                     .square()
                                     .matrix()
                                     .asDiagonal();
        input.speed_m_s = velocity.norm();
        if (i % params_.scan_every == 0) {
          scan_from(p_m, heading_rad, input.stamp_ns);
          const Pose2 T{p_m + error_m, heading_rad + yaw_error_rad};
          // As by inertial navigation: smooth, but drifting, and placed in the world by GPS.
          const Eigen::Vector2d drift_m_s = 0.02 * Eigen::Vector2d(0.6, -0.8);
          const double turn_rad_s = radians(0.01);
          const Pose2 T_odom_world = {t_s * drift_m_s, turn_rad_s * t_s};
          const Pose2 T_odom_base = T_odom_world * Pose2{p_m, heading_rad};
          InertialPlacement placement;
          placement.T_world_odom = T * inverse(T_odom_base);
          placement.pose_covariance = input.covariance_world;
          placement.v_odom_m_s =
              T_odom_world.rotation() * (velocity + turn_rad_s * Eigen::Vector2d(-p_m.y(), p_m.x())) + drift_m_s;
          placement.v_world_m_s = velocity;
          placement.velocity_sigma_m_s = 0.05;
          const Eigen::Isometry3d T_odom_lidar = in_space(T_odom_base);
          if (params_.is_mapped) {
            pipeline.process(scan_, T_odom_lidar, T_odom_lidar, placement);
            map_ = pipeline.map(std::move(map_));
          }
          map_.stamp_ns = input.stamp_ns;
          sight_.T_world_sensor = T;
          sight_.hits_world_m.clear();
          for (std::size_t k = 0; k < ranges_m_.size(); ++k) {
            if (!(ranges_m_[k] < kReach_m)) continue;
            const double angle_rad = scan_.angle_min_rad + static_cast<double>(k) * scan_.angle_increment_rad;
            sight_.hits_world_m.emplace_back(sight_.free_m[k] * std::cos(angle_rad),
                                             sight_.free_m[k] * std::sin(angle_rad));
          }
          sight_of_base_ = sight_;
          sight_of_base_.T_world_sensor = {};
          for (Eigen::Vector2d& hit_m : sight_.hits_world_m) hit_m = T * hit_m;
          input.sight = &sight_;
        }
        input.heading_rad = heading_rad + yaw_error_rad;
        input.map = &map_;
        if (spoil) spoil(t_s, input, sight_of_base_);
        const double begin_us = thread_cpu_us();
        const MissionStep& step = mission.step(input);
        flight.step_us.push_back(thread_cpu_us() - begin_us);
        // Of the speed that the vehicle is told, as it turns with its own.
        told_1_m = step.curvature_1_m * step.speed_m_s / velocity.norm();
        flight.greatest_path_1_m = std::max(flight.greatest_path_1_m, greatest_curvature_1_m(mission.path()));
        flight.laps = std::max(flight.laps, step.laps);
        flight.held_s += step.state == MissionState::kHold ? 2.0 * kControl_s : 0.0;
        flight.reason = step.reason;
        flight.given_up = static_cast<int>(step.given_up);
        if (on_step) on_step(t_s, input, mission, step, p_m);
        if (step.state == MissionState::kDone) {
          flight.ended = true;
          count(mission.boundaries(), flight);
          break;
        }
      }
      // It turns after the command by the lag, with the rate that is asked for over ground, if it can.
      curvature_1_m += (told_1_m - curvature_1_m) * kControl_s / kMissionLag_s;
      const double rate_rad_s = std::clamp(curvature_1_m * velocity.norm(), -kCurvature_1_m * kMissionSpeed_m_s,
                                           kCurvature_1_m * kMissionSpeed_m_s);
      heading_rad += rate_rad_s * kControl_s;
      const Eigen::Vector2d gust = params_.gust_m_s * Eigen::Vector2d(std::sin(0.7 * t_s), std::cos(0.43 * t_s));
      velocity = kMissionSpeed_m_s * Eigen::Vector2d(std::cos(heading_rad), std::sin(heading_rad)) + wind_ + gust;
      p_m += velocity * kControl_s;
      flight.greatest_1_m = std::max(flight.greatest_1_m, std::abs(rate_rad_s) / kMissionSpeed_m_s);
      for (std::size_t k = 0; k < towers_.size(); ++k) {
        const Outline& tower = towers_[k];
        const Eigen::Vector2d to_m = p_m - middle_of(tower), from_m = to_m - velocity * kControl_s;
        turned_rad_[k] += std::atan2(cross(from_m, to_m), from_m.dot(to_m));
        const double distance_m = is_inside(tower, p_m) ? 0.0 : distance_to(tower, p_m);
        flight.least_clearance_m = std::min(flight.least_clearance_m, distance_m);
      }
    }
    return flight;
  }

  std::function<void(double, const MissionInput&, const Circumnavigation&, const MissionStep&, const Eigen::Vector2d&)>
      on_step;
  /// Spoils the input of a step. The sight, if there is one, is that in the frame of the vehicle's body, too.
  std::function<void(double, MissionInput&, const FreeBeams&)> spoil;

 private:
  static Eigen::Isometry3d in_space(const Pose2& pose) {
    Eigen::Isometry3d T = Eigen::Isometry3d::Identity();
    T.translation().head<2>() = pose.translation_m;
    T.linear() = Eigen::AngleAxisd(pose.yaw_rad, Eigen::Vector3d::UnitZ()).toRotationMatrix();
    return T;
  }

  /// Towers along all of whose outline there is a closed boundary.
  void count(const std::vector<Splinegon>& boundaries, MissionFlight& flight) const {
    for (std::size_t i = 0; i < towers_.size(); ++i) {
      const Outline& tower = towers_[i];
      bool is_closed = false;
      for (const Splinegon& boundary : boundaries) {
        if (!boundary.closed) continue;
        double greatest_m = 0.0;
        for (const Eigen::Vector2d& p : tower) greatest_m = std::max(greatest_m, distance_m(boundary, p));
        is_closed = is_closed || greatest_m < 1.0;
      }
      flight.closed += is_closed ? 1 : 0;
      flight.around += is_closed || std::abs(turned_rad_[i]) > 0.9 * 2.0 * kPi ? 1 : 0;
    }
  }

  void scan_from(const Eigen::Vector2d& p_m, double yaw_rad, std::int64_t stamp_ns) {
    const double step_rad = scan_.angle_increment_rad;
    const auto count = static_cast<std::size_t>(params_.beams);
    ranges_m_.assign(count, std::numeric_limits<double>::infinity());
    for (const Outline& tower : towers_) {
      for (std::size_t k = 0; k < tower.size(); ++k) {
        const Eigen::Vector2d b = tower[k] - p_m, a = tower[(k + 1) % tower.size()] - p_m;
        const double turn_rad = std::atan2(cross(a, b), a.dot(b));
        if (turn_rad < 0.0) continue;  // on the far side
        const double from_rad = wrap_to_pi(std::atan2(a.y(), a.x()) - yaw_rad) - scan_.angle_min_rad;
        const Eigen::Vector2d normal = left_of(b - a);
        for (const double round_rad : {0.0, -2.0 * kPi, 2.0 * kPi}) {
          const double first = std::ceil((from_rad + round_rad) / step_rad);
          const double last = std::floor((from_rad + round_rad + turn_rad) / step_rad);
          for (double beam = std::max(first, 0.0); beam <= std::min(last, static_cast<double>(count) - 1.0);
               beam += 1.0) {
            const double angle_rad = yaw_rad + scan_.angle_min_rad + beam * step_rad;
            const double along = normal.dot(Eigen::Vector2d(std::cos(angle_rad), std::sin(angle_rad)));
            if (std::abs(along) < 1e-12) continue;
            double& range_m = ranges_m_[static_cast<std::size_t>(beam)];
            range_m = std::min(range_m, normal.dot(a) / along);
          }
        }
      }
    }
    scan_.stamp_ns = stamp_ns;
    scan_.beams.clear();
    sight_.from_rad = scan_.angle_min_rad;
    sight_.step_rad = step_rad;
    sight_.free_m.clear();
    for (const double range_m : ranges_m_) {
      const double measured_m = range_m < kReach_m ? range_m + params_.range_sigma_m * random_.normal() : range_m;
      scan_.beams.push_back(beam_from_range(static_cast<float>(measured_m), 0.1F, static_cast<float>(kReach_m)));
      sight_.free_m.push_back(std::min(measured_m, kReach_m));
    }
  }

  MissionFlightParams params_;
  std::vector<Outline> towers_;
  Random random_;
  Eigen::Vector2d wind_;
  Scan scan_;
  FreeBeams sight_, sight_of_base_;
  Map map_;
  std::vector<double> ranges_m_;
  std::vector<double> turned_rad_;  ///< around each tower
};

/// The flight of one seeded world: from outside, past five places in turn.
inline MissionFlight fly_in_world(std::uint64_t seed, int most_towers, const MissionFlightParams& params) {
  Random random(seed);
  const std::vector<Outline> towers = random_towers(random, most_towers);
  MissionSimulation simulation(towers, params, seed + 1'000);
  std::vector<DubinsEnd> search;
  for (const Eigen::Vector2d& p :
       std::vector<Eigen::Vector2d>{{-30.0, -30.0}, {30.0, -30.0}, {30.0, 30.0}, {-30.0, 30.0}, {0.0, 0.0}}) {
    search.push_back({p, std::nullopt, 1.0});
  }
  return simulation.fly({{-85.0, -50.0}, 0.3}, search);
}

}  // namespace situation_awareness

// SPDX-License-Identifier: BSD-3-Clause
#include "situation_awareness/evaluation/scout_missions.hpp"

#include <algorithm>
#include <chrono>
#include <cmath>
#include <limits>
#include <memory>
#include <utility>

#include "situation_awareness/common/random.hpp"
#include "situation_awareness/common/time.hpp"
#include "situation_awareness/geometry/angles.hpp"
#include "situation_awareness/pipeline/grid_pipeline.hpp"

namespace situation_awareness {
namespace {

constexpr double kStep_s = 0.1;
constexpr double kLead_s = 0.25;  ///< between steps of the mission
constexpr double kGrid_s = 5.0;   ///< between grids that the mission gets
constexpr double kEdge_m = 6.0;   ///< of cars from the region's edge
constexpr double kCarsApart_m = 8.0;
constexpr double kTreeApart_m = 4.5;  ///< of a tree from a car
constexpr double kElevationPixel_m = 1.0;
constexpr double kElevationBeside_m = 130.0;  ///< that the elevation reaches beyond the region

/// It flies straight to its goal, brakes in time, and turns at a constant rate.
struct KinematicMultirotor {
  Eigen::Vector3d p_m = Eigen::Vector3d::Zero();
  Eigen::Vector3d v_m_s = Eigen::Vector3d::Zero();
  double yaw_rad = 0.0;

  void fly(const Eigen::Vector3d& goal_m, double goal_yaw_rad, const ScoutingParams& params) {
    const Eigen::Vector3d to_goal_m = goal_m - p_m;
    const double distance_m = to_goal_m.norm();
    Eigen::Vector3d wanted_m_s = Eigen::Vector3d::Zero();
    if (distance_m > 1e-6) {
      const double speed_m_s = std::min({params.speed_m_s, std::sqrt(2.0 * 0.8 * params.acceleration_m_s2 * distance_m),
                                         distance_m / (2.0 * kStep_s)});
      wanted_m_s = to_goal_m / distance_m * speed_m_s;
    }
    const Eigen::Vector3d change_m_s = wanted_m_s - v_m_s;
    const double most_m_s = params.acceleration_m_s2 * kStep_s;
    v_m_s += change_m_s.norm() > most_m_s ? Eigen::Vector3d(change_m_s.normalized() * most_m_s) : change_m_s;
    p_m += v_m_s * kStep_s;
    const double turn_rad = wrap_to_pi(goal_yaw_rad - yaw_rad), most_rad = params.yaw_rate_rad_s * kStep_s;
    yaw_rad = wrap_to_pi(yaw_rad + std::clamp(turn_rad, -most_rad, most_rad));
  }
};

PinholeCamera camera_of_mission(const ScoutMission& mission) {
  const int size = mission.label_px;
  PinholeCamera camera{size, size, 0.0, 0.0, 0.5 * (size - 1), 0.5 * (size - 1)};
  camera.fx_px = 0.5 * size / std::tan(0.5 * mission.params.camera.field_of_view_rad);
  camera.fy_px = 0.5 * size / std::tan(0.5 * mission.params.camera.vertical_field_of_view_rad);
  return camera;
}

Elevation elevation_of_mission(const ScoutMission& mission, std::uint64_t seed) {
  Random random(seed * 2654435761U + 17U);
  const ScoutRegion& region = mission.params.region;
  const double west_m = region.x_min_world_m - kElevationBeside_m, north_m = region.y_max_world_m + kElevationBeside_m;
  const int width = static_cast<int>((region.x_max_world_m + kElevationBeside_m - west_m) / kElevationPixel_m);
  const int height = static_cast<int>((north_m - region.y_min_world_m + kElevationBeside_m) / kElevationPixel_m);
  std::vector<float> heights_m;
  for (int row = 0; row < height; ++row) {
    for (int column = 0; column < width; ++column) {
      heights_m.push_back(static_cast<float>(
          mission.scene.ground(west_m + (column + 0.5) * kElevationPixel_m, north_m - (row + 0.5) * kElevationPixel_m) +
          mission.elevation_bias_m + mission.elevation_noise_m * random.normal()));
    }
  }
  return {width, height, {west_m, north_m}, {kElevationPixel_m, kElevationPixel_m}, std::move(heights_m)};
}

/// The flight, its images, and what was found until now.
class MissionFlight {
 public:
  MissionFlight(const ScoutMission& mission, std::uint64_t seed)
      : mission_(mission),
        camera_(camera_of_mission(mission)),
        elevation_(std::make_shared<Elevation>(elevation_of_mission(mission, seed))),
        pipeline_(GridPipelineParams{}, elevation_),
        first_found_s_(mission.scene.cars.size(), std::numeric_limits<double>::infinity()) {
    outcome_.cars = static_cast<int>(mission.scene.cars.size());
    outcome_.least_clearance_m = std::numeric_limits<double>::infinity();
    vehicle_.p_m = home_m();
    vehicle_.yaw_rad = 0.5 * kPi;
  }

  Eigen::Vector3d home_m() const {
    const Eigen::Vector2d& p_m = mission_.home_world_m;
    return {p_m.x(), p_m.y(), mission_.scene.ground(p_m.x(), p_m.y()) + mission_.params.height_m};
  }
  const KinematicMultirotor& vehicle() const { return vehicle_; }
  const Elevation& elevation() const { return *elevation_; }
  double time_s() const { return step_ * kStep_s; }
  std::int64_t stamp_ns() const { return nanoseconds(time_s()) + 1'000'000'000; }
  const GridPipeline& pipeline() const { return pipeline_; }
  ScoutMissionOutcome& outcome() { return outcome_; }

  /// Whether an image is due, which is mapped then.
  bool look() {
    if (time_s() < next_image_s_ - 1e-9) return false;
    next_image_s_ += 1.0 / mission_.params.image_rate_hz;
    const Eigen::Isometry3d T = camera_pose(vehicle_.p_m, vehicle_.yaw_rad, mission_.params.camera.pitch_rad);
    SoftLabels labels = label_image_of(mission_.scene, camera_, T, 2);
    labels.stamp_ns = stamp_ns();
    const std::vector<int> target_of = targets_of(mission_.scene.cars, pipeline_.process(labels, T));
    for (std::size_t i = 0; i < first_found_s_.size(); ++i) {
      if (target_of[i] >= 0) first_found_s_[i] = std::min(first_found_s_[i], time_s());
    }
    return true;
  }

  void fly(const Eigen::Vector3d& goal_m, double yaw_rad) {
    const Eigen::Vector3d from_m = vehicle_.p_m;
    vehicle_.fly(goal_m, yaw_rad, mission_.params);
    outcome_.way_m += (vehicle_.p_m - from_m).norm();
    outcome_.least_clearance_m =
        std::min(outcome_.least_clearance_m, distance_m(mission_.obstacles, vehicle_.p_m.head<2>()));
    if (step_++ % 10 == 0) outcome_.flown_m.push_back(vehicle_.p_m);
  }

  void finish() {
    const GridTargets& targets = pipeline_.targets();
    const std::vector<int> target_of = targets_of(mission_.scene.cars, targets);
    double last_s = 0.0;
    for (std::size_t i = 0; i < first_found_s_.size(); ++i) {
      if (target_of[i] >= 0) {
        const Eigen::Vector3d& p_m = targets.targets[static_cast<std::size_t>(target_of[i])].p_world_m;
        const double distance_m = (p_m.head<2>() - mission_.scene.cars[i].T_world_car.translation_m).norm();
        ++outcome_.found;
        outcome_.worst_centroid_m = std::max(outcome_.worst_centroid_m, distance_m);
      }
      last_s = std::max(last_s, std::min(first_found_s_[i], mission_.params.budget_s));
    }
    outcome_.last_found_s = last_s;
    outcome_.wrong = static_cast<int>(targets.targets.size()) - outcome_.found;
  }

 private:
  const ScoutMission& mission_;
  PinholeCamera camera_;
  std::shared_ptr<const Elevation> elevation_;
  GridPipeline pipeline_;
  KinematicMultirotor vehicle_;
  std::vector<double> first_found_s_;
  int step_ = 0;
  double next_image_s_ = 0.0;
  ScoutMissionOutcome outcome_;
};

}  // namespace

ScoutMission random_scout_mission(std::uint64_t seed, bool hills) {
  ScoutMission mission;
  Random random(seed);
  const ScoutRegion& region = mission.params.region;
  if (hills) {
    std::vector<Eigen::Vector4d> bumps;  // x, y, height, sigma
    for (int i = 0; i < 6; ++i) {
      bumps.emplace_back(random.uniform(-130.0, 130.0), random.uniform(-130.0, 130.0), random.uniform(-5.0, 5.0),
                         random.uniform(30.0, 60.0));
    }
    mission.scene.ground = [bumps](double x, double y) {
      double z_m = 0.0;
      for (const Eigen::Vector4d& bump : bumps) {
        const double d2 = (x - bump(0)) * (x - bump(0)) + (y - bump(1)) * (y - bump(1));
        z_m += bump(2) * std::exp(-d2 / (2.0 * bump(3) * bump(3)));
      }
      return z_m;
    };
    for (const Eigen::Vector4d& bump : bumps) mission.scene.steepest += std::abs(bump(2)) / bump(3) * std::exp(-0.5);
    mission.elevation_bias_m = random.uniform(-0.5, 0.5);
    mission.elevation_noise_m = 0.2;
  } else {
    mission.scene.ground = [](double, double) { return 0.0; };
  }
  const auto place = [&](double edge_m) {
    return Eigen::Vector2d(random.uniform(region.x_min_world_m + edge_m, region.x_max_world_m - edge_m),
                           random.uniform(region.y_min_world_m + edge_m, region.y_max_world_m - edge_m));
  };
  std::vector<SceneCar>& cars = mission.scene.cars;
  while (cars.size() < 12) {
    const Pose2 T{place(kEdge_m), random.uniform(-kPi, kPi)};
    const bool is_near = std::any_of(cars.begin(), cars.end(), [&](const SceneCar& car) {
      return (car.T_world_car.translation_m - T.translation_m).norm() < kCarsApart_m;
    });
    if (!is_near) cars.push_back({T});
  }
  std::vector<SceneTree>& trees = mission.scene.trees;
  while (trees.size() < 40) {
    const Eigen::Vector2d p_m = place(0.0);
    const bool is_near = std::any_of(cars.begin(), cars.end(), [&](const SceneCar& car) {
      return (car.T_world_car.translation_m - p_m).norm() < kTreeApart_m;
    });
    if (!is_near) trees.push_back({p_m, random.uniform(1.5, 3.0), random.uniform(3.0, 4.5)});
  }
  return mission;
}

ScoutMissionOutcome fly_scouting(const ScoutMission& mission, std::uint64_t seed) {
  MissionFlight flight(mission, seed);
  Scouting scouting(mission.params, flight.home_m(), [&](double x, double y) { return flight.elevation().at(x, y); });
  double next_lead_s = 0.0, next_grid_s = kGrid_s;
  ScoutingStep led;
  bool has_obstacles = mission.obstacles.pieces().empty();
  while (flight.time_s() < mission.params.budget_s + 60.0) {
    if (flight.look()) scouting.add_image(flight.vehicle().p_m, flight.vehicle().yaw_rad);
    if (flight.time_s() >= next_lead_s - 1e-9) {
      next_lead_s += kLead_s;
      ScoutingInput input;
      input.stamp_ns = flight.stamp_ns();
      input.p_world_m = flight.vehicle().p_m;
      input.yaw_rad = flight.vehicle().yaw_rad;
      input.targets = &flight.pipeline().targets();
      SemanticGrid grid;
      if (flight.time_s() >= next_grid_s) {
        next_grid_s += kGrid_s;
        grid = flight.pipeline().map().grid();
        input.grid = &grid;
      }
      if (!has_obstacles) input.obstacles = &mission.obstacles;
      has_obstacles = true;
      const auto begin = std::chrono::steady_clock::now();
      led = scouting.step(input);
      flight.outcome().longest_step_s =
          std::max(flight.outcome().longest_step_s,
                   std::chrono::duration<double>(std::chrono::steady_clock::now() - begin).count());
      if (led.state == ScoutingState::kDone) break;
    }
    flight.fly(led.go_to_world_m, led.yaw_rad);
  }
  flight.finish();
  ScoutMissionOutcome& outcome = flight.outcome();
  outcome.close_ups = static_cast<int>(led.close_ups);
  outcome.home_s = led.state == ScoutingState::kDone ? flight.time_s() : std::numeric_limits<double>::infinity();
  outcome.home_in_time = outcome.home_s <= mission.params.budget_s;
  return outcome;
}

ScoutMissionOutcome fly_lawnmower(const ScoutMission& mission, double lane_m, std::uint64_t seed) {
  MissionFlight flight(mission, seed);
  const ScoutRegion& region = mission.params.region;
  const auto corners_of = [&](bool along_y) {
    std::vector<Eigen::Vector2d> corners;
    const double low = along_y ? region.x_min_world_m : region.y_min_world_m;
    const double high = along_y ? region.x_max_world_m : region.y_max_world_m;
    const double begin = along_y ? region.y_min_world_m : region.x_min_world_m;
    const double end = along_y ? region.y_max_world_m : region.x_max_world_m;
    const int lanes = std::max(1, static_cast<int>(std::ceil((high - low) / lane_m - 1e-9)));
    for (int i = 0; i < lanes; ++i) {
      const double across = low + (i + 0.5) * (high - low) / lanes;
      for (const double along : {i % 2 == 0 ? begin : end, i % 2 == 0 ? end : begin}) {
        corners.emplace_back(along_y ? Eigen::Vector2d(across, along) : Eigen::Vector2d(along, across));
      }
    }
    return corners;
  };
  std::vector<Eigen::Vector2d> corners = corners_of(false);
  const std::vector<Eigen::Vector2d> along_y = corners_of(true);
  corners.insert(corners.end(), along_y.begin(), along_y.end());
  std::size_t next = 0;
  bool goes_home = false;
  while (flight.time_s() < mission.params.budget_s) {
    flight.look();
    const Eigen::Vector3d& p_m = flight.vehicle().p_m;
    const double home_s = (p_m - flight.home_m()).norm() / mission.params.speed_m_s +
                          mission.params.speed_m_s / mission.params.acceleration_m_s2 + mission.params.margin_s;
    while (next < corners.size() && (corners[next] - p_m.head<2>()).norm() < mission.params.arrival_m) ++next;
    if (next == corners.size() || flight.time_s() + home_s > mission.params.budget_s) goes_home = true;
    if (goes_home) {
      if ((p_m - flight.home_m()).norm() < 2.0) break;
      flight.fly(flight.home_m(), flight.vehicle().yaw_rad);
      continue;
    }
    const Eigen::Vector2d to_m = corners[next] - p_m.head<2>();
    double z_m = -std::numeric_limits<double>::infinity();
    for (double part : {0.0, 0.25, 0.5}) {
      const Eigen::Vector2d at_m = p_m.head<2>() + part * std::min(1.0, 40.0 / to_m.norm()) * to_m;
      z_m = std::max(z_m, flight.elevation().at(at_m.x(), at_m.y()) + mission.params.height_m);
    }
    flight.fly({corners[next].x(), corners[next].y(), z_m}, std::atan2(to_m.y(), to_m.x()));
  }
  flight.finish();
  ScoutMissionOutcome& outcome = flight.outcome();
  outcome.home_s =
      (flight.vehicle().p_m - flight.home_m()).norm() < 2.0 ? flight.time_s() : std::numeric_limits<double>::infinity();
  outcome.home_in_time = outcome.home_s <= mission.params.budget_s;
  return outcome;
}

}  // namespace situation_awareness

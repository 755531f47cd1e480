// SPDX-License-Identifier: BSD-3-Clause
// What the parts of the node `simulator` share: parameters, world, clock.
#pragma once

#include <cstdint>
#include <stdexcept>
#include <string>
#include <utility>

#include <ros/node_handle.h>
#include <ros/time.h>
#include <tf2_ros/static_transform_broadcaster.h>
#include <tf2_ros/transform_broadcaster.h>

#include "situation_awareness/path/rounds.hpp"
#include "situation_awareness/ros/simulated_clock.hpp"
#include "situation_awareness/sim/schedule.hpp"
#include "situation_awareness/sim/sensors.hpp"
#include "situation_awareness/sim/transits.hpp"
#include "situation_awareness/sim/world.hpp"

#include "../simulated_robot.hpp"

namespace situation_awareness {

/// Which parameters there are depends on the vehicle.
struct SimulatorParams {
  VehicleKind vehicle;
  std::string world = kDefaultWorld;
  bool clock = true;
  double rate = 1.0;
  int seed = 1;
  double duration_s = 0.0;
  int rings = 0;
  std::string label_class = "car";
  int label_block_px = 8;
  std::string world_frame = "world";
  std::string odom_frame = "odom";
  std::string robot_frame = "base_link";
  std::string lidar_frame = "laser";
  double fix_delay_s = 0.1;
  bool true_localization = false;
  bool scripted = true;
  TransitsParams transits;
  int rounds = 0;
  RoundsParams flight;
  double half_region_m = 85.0;
  double lane_m = 42.5;
  double heading_sigma_rad = 0.02;
  double altitude_sigma_m = 0.3;

  explicit SimulatorParams(VehicleKind kind) : vehicle(kind) {
    if (kind == VehicleKind::kUnicycle) world_frame = "map";
    if (kind != VehicleKind::kPath) return;
    robot_frame = "robot";
    lidar_frame = "lidar";
  }

  bool is_led() const { return vehicle != VehicleKind::kPath; }

  template <class Self, class Visit>
  static void fields(Self& self, Visit&& visit) {
    visit("world", self.world, "name of a world in models/worlds, or a path");
    visit("clock", self.clock, "publish /clock; false: stamps of the wall clock");
    visit("rate", self.rate, Bounds{self.is_led() ? 0.01 : 0.0, 100.0}, "",
          "simulated seconds per second; 0, of a robot on a path: as fast as the map follows");
    visit("seed", self.seed, Bounds{0, 2147483647}, "", "seed of the noise");
    visit("duration_s", self.duration_s, Bounds{0.0, 1e6}, "s", "simulated time until it ends; 0: never");
    visit("rings", self.rings, Bounds{0, 256}, "",
          "rings of a ring scanner that replaces the world's scanners; 0: those of the world");
    visit("label_class", self.label_class,
          "labels are the share of a pixel that shows a material whose name begins so");
    visit("label_block_px", self.label_block_px, Bounds{1, 64}, "px",
          "so many pixels of the camera, along both edges, make one of the labels");
    visit("world_frame", self.world_frame, "frame of the truth");
    visit("lidar_frame", self.lidar_frame, "frame of the scans");
    visit(self.is_led() ? "base_frame" : "robot_frame", self.robot_frame, "frame of the robot's body");
    if (!self.is_led()) return;
    visit("fix_delay_s", self.fix_delay_s, Bounds{0.0, 1.0}, "s", "from the stamp of a fix until it is published");
    visit("true_localization", self.true_localization,
          "publish the true transform from world_frame to the robot's (a unicycle: to odom_frame), in the place of a "
          "localisation");
    if (self.vehicle == VehicleKind::kUnicycle) {
      visit("odom_frame", self.odom_frame, "frame of the odometry, parent of the vehicle's in TF");
      TransitsParams::fields(self.transits, visit);
      return;
    }
    visit("scripted", self.scripted, "fly as the parameters below say; false: as it is led, by cmd_vel or go_to");
    if (self.vehicle == VehicleKind::kFixedWing) {
      visit("rounds", self.rounds, Bounds{0, 1000}, "", "how many of the world's rounds; 0: all");
      RoundsParams::fields(self.flight, visit);
      return;
    }
    visit("half_region_m", self.half_region_m, Bounds{1.0, 1e4}, "m",
          "half of the edge of the region over which it flies to and fro");
    visit("lane_m", self.lane_m, Bounds{1.0, 1e4}, "m", "between two lanes of that flight");
    visit("heading_sigma_rad", self.heading_sigma_rad, Bounds{0.0, 1.0}, "rad",
          "of the compass: the same of an error that stays and of one of each reading");
    visit("altitude_sigma_m", self.altitude_sigma_m, Bounds{0.0, 100.0}, "m",
          "of the altimeter, a barometer that was set at the start: the same");
  }

  /// Throws std::invalid_argument.
  void validate() const {
    if (!clock && (rate != 1.0 || !ros::Time::isSystemTime())) {
      throw std::invalid_argument("clock = false is the wall clock: it needs rate = 1 and /use_sim_time = false");
    }
  }
};

struct Simulation {
  Simulation(const ros::NodeHandle& ros_node, const SimulatorParams& given, World& its_world, WorldSensors its_sensors)
      : node(ros_node),
        params(given),
        world(its_world),
        sensors(std::move(its_sensors)),
        // Those that steer are easier overrun than a map.
        clock(node, params.rate, !params.clock, params.is_led() ? 0.1 : 0.25) {}

  ros::NodeHandle node;
  SimulatorParams params;
  World& world;
  WorldSensors sensors;  ///< those of the world, or with `rings` that in the place of its scanners
  SimulatedClock clock;
  Schedule schedule;
  tf2_ros::TransformBroadcaster tf;
  tf2_ros::StaticTransformBroadcaster static_tf;

  std::uint64_t seed() const { return static_cast<std::uint64_t>(params.seed); }
};

}  // namespace situation_awareness

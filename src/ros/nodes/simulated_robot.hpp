// SPDX-License-Identifier: BSD-3-Clause
// What the nodes `simulator` and `evaluator` ask of a world: how its robot moves.
#pragma once

#include <array>
#include <cstddef>
#include <string>

#include "situation_awareness/common/params.hpp"
#include "situation_awareness/ros/params/param_reader.hpp"
#include "situation_awareness/sim/world.hpp"

namespace situation_awareness {

/// How the robot of a world moves: along the path of the file, or as it is led.
enum class VehicleKind { kPath, kUnicycle, kFixedWing, kMultirotor };

constexpr const char* kDefaultWorld = "demo";

inline VehicleKind kind_of(World& world) {
  if (world.vehicle() != nullptr) return VehicleKind::kUnicycle;
  if (world.aircraft() != nullptr) return VehicleKind::kFixedWing;
  return world.multirotor() != nullptr ? VehicleKind::kMultirotor : VehicleKind::kPath;
}

/// Refuses a parameter that a node does not have for the robot of a world, whose name it tells.
inline OnUnknownKey refuse_for_robot(const std::string& world, VehicleKind kind) {
  return [world, kind](UnknownKey key) {
    constexpr std::array kRobots{"on a path", "a unicycle", "a fixed_wing", "a multirotor"};
    key.source += ": the robot of " + world + " is " + kRobots.at(static_cast<std::size_t>(kind));
    refuse(key);
  };
}

}  // namespace situation_awareness

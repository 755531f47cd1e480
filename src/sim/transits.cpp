// SPDX-License-Identifier: BSD-3-Clause
#include "situation_awareness/sim/transits.hpp"

#include <algorithm>
#include <cmath>
#include <stdexcept>

#include "situation_awareness/geometry/angles.hpp"

namespace situation_awareness {
namespace {

constexpr double kMoves_m_s = 0.01, kMoves_rad_s = 0.01;  ///< faster than this is no rest
constexpr double kTurned_rad = 0.01;                      ///< near enough to the heading
constexpr double kTurnGain_1_s = 2.0;                     ///< yaw rate by what is left to turn

Unicycle& required_vehicle(World& world) {
  if (world.vehicle() == nullptr) {
    throw std::runtime_error(world.path() + ": 'robot' is no vehicle, whose text begins with unicycle");
  }
  if (world.docks().empty()) throw std::runtime_error(world.path() + ": there is no numeric 'docks'");
  return *world.vehicle();
}

}  // namespace

Transits::Transits(World& world, const TransitsParams& params)
    : world_(world), vehicle_(required_vehicle(world)), params_(params) {
  params.validate();
  const Pose2& T_world_robot = vehicle_.state().T_world_robot;
  start_m_ = T_world_robot.translation_m;
  heading_rad_ = T_world_robot.yaw_rad;
  begin_s_ = vehicle_.time_s();
  world_.begin_transit(transit_, begin_s_);
}

void Transits::command(double speed_m_s, double yaw_rate_rad_s) {
  if (!docked_) vehicle_.command(speed_m_s, yaw_rate_rad_s);
}

void Transits::advance(double time_s) {
  if (docked_) stay_docked();
  vehicle_.advance(time_s);
  const UnicycleState& state = vehicle_.state();
  if (std::abs(state.speed_m_s) > kMoves_m_s || std::abs(state.yaw_rate_rad_s) > kMoves_rad_s) {
    moved_s_ = vehicle_.time_s();
  }
  if (!docked_ && has_arrived()) {
    docked_ = true;
    changed_ = false;
    docked_since_s_ = vehicle_.time_s();
    done_ = transit_ == params_.transits;
  }
}

bool Transits::has_arrived() {
  const std::vector<Eigen::Vector2d>& docks = world_.docks();
  const Eigen::Vector2d p_world_m = vehicle_.state().T_world_robot.translation_m;
  has_left_ = has_left_ || (p_world_m - start_m_).norm() > 2.0 * params_.dock_radius_m;
  const Eigen::Vector2d& ahead_m = docks[static_cast<std::size_t>(transit_) % docks.size()];
  return has_left_ && (p_world_m - ahead_m).norm() <= params_.dock_radius_m &&
         vehicle_.time_s() - moved_s_ >= params_.at_rest_s;
}

void Transits::stay_docked() {
  const double since_s = vehicle_.time_s() - docked_since_s_;
  if (done_) return vehicle_.command(0.0, 0.0);
  if (!changed_ && since_s >= 0.5 * params_.docked_s) {
    changed_ = true;
    // The time of the transit that comes is 0 when the vehicle is free; until then no one looks.
    world_.begin_transit(transit_ + 1, vehicle_.time_s());
    if (world_.docks().size() == 2) {
      const Eigen::Vector2d& ahead_m = world_.docks()[static_cast<std::size_t>(transit_ + 1) % 2];
      const Eigen::Vector2d way_m = ahead_m - vehicle_.state().T_world_robot.translation_m;
      heading_rad_ = std::atan2(way_m.y(), way_m.x());
    }
  }
  if (!changed_) return vehicle_.command(0.0, 0.0);
  const double left_rad = wrap_to_pi(heading_rad_ - vehicle_.state().T_world_robot.yaw_rad);
  const bool has_turned = std::abs(left_rad) < kTurned_rad;
  vehicle_.command(
      0.0, has_turned ? 0.0 : std::clamp(kTurnGain_1_s * left_rad, -params_.turn_rate_rad_s, params_.turn_rate_rad_s));
  if (has_turned && vehicle_.state().yaw_rate_rad_s == 0.0 && since_s >= params_.docked_s) {
    docked_ = false;
    has_left_ = false;
    ++transit_;
    begin_s_ = moved_s_ = vehicle_.time_s();
    start_m_ = vehicle_.state().T_world_robot.translation_m;
    world_.begin_transit(transit_, begin_s_);
  }
}

}  // namespace situation_awareness

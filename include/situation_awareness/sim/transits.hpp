// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include "situation_awareness/common/params.hpp"
#include "situation_awareness/sim/unicycle.hpp"
#include "situation_awareness/sim/world.hpp"

namespace situation_awareness {

struct TransitsParams {
  int transits = 6;
  double dock_radius_m = 0.3;
  double at_rest_s = 0.5;
  double docked_s = 6.0;
  double turn_rate_rad_s = 1.0;

  template <class Self, class Visit>
  static void fields(Self& self, Visit&& visit) {
    visit("transits", self.transits, Bounds{1, 100000}, "", "from dock to dock");
    visit("dock_radius_m", self.dock_radius_m, Bounds{0.01, 10.0}, "m", "a vehicle that stands this near is docked");
    visit("at_rest_s", self.at_rest_s, Bounds{0.0, 100.0}, "s", "how long it must stand");
    visit("docked_s", self.docked_s, Bounds{0.1, 1e4}, "s", "least time in the dock");
    visit("turn_rate_rad_s", self.turn_rate_rad_s, Bounds{0.1, 5.0}, "rad/s", "of the turn in the dock, at most");
  }

  /// Throws std::invalid_argument naming field and bound.
  void validate() const { check_bounds(*this, "transits"); }
};

/// The vehicle of a world drives from dock to dock, by commands. It is docked where it has come to rest near the dock
/// ahead: from then on commands count for nothing and the scanner is off. In the middle of its time there what stands
/// in the world changes (World::begin_transit); the vehicle turns on the spot towards the other dock, and is free
/// again. With one dock each transit is a round, and the vehicle keeps its heading. After the last transit it stays.
class Transits {
 public:
  /// `world` must outlive this. Throws std::invalid_argument for params, std::runtime_error for a world without a
  /// vehicle or docks.
  Transits(World& world, const TransitsParams& params);

  /// The vehicle's command from now on; ignored in a dock.
  void command(double speed_m_s, double yaw_rate_rad_s);

  /// Moves the vehicle on. Call it at least ten times per second of the simulation.
  void advance(double time_s);

  /// Whether the vehicle is in a dock, its scanner off.
  bool docked() const { return docked_; }

  /// In the dock after the last transit.
  bool done() const { return done_; }

  /// The number of this transit, or of the one before while docked; from 1.
  int transit() const { return transit_; }

  /// When this transit began, or the one before while docked: the vehicle was set free.
  double begin_s() const { return begin_s_; }

  /// When it ended, while docked.
  double end_s() const { return docked_since_s_; }

 private:
  bool has_arrived();
  void stay_docked();

  World& world_;
  Unicycle& vehicle_;
  TransitsParams params_;
  Eigen::Vector2d start_m_;  ///< of this transit
  double heading_rad_;       ///< for the next one
  bool has_left_ = false;
  bool docked_ = false;
  bool done_ = false;
  bool changed_ = false;  ///< what stands in the world, since the vehicle docked
  int transit_ = 1;
  double begin_s_ = 0.0;
  double docked_since_s_ = 0.0;
  double moved_s_ = 0.0;  ///< when the vehicle last moved
};

}  // namespace situation_awareness

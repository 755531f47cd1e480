// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <string>
#include <vector>

#include <Eigen/Core>

#include "situation_awareness/common/params.hpp"

namespace situation_awareness {

/// Outline of a vehicle: a convex polygon in the frame of its base, counter-clockwise, with the base's origin inside.
struct Footprint {
  std::vector<Eigen::Vector2d> corners_m;
};

/// The footprint as YAML text, [[x, y], ...], that is read back exactly.
std::string yaml_text(const Footprint& footprint);

/// Throws std::invalid_argument if the text is not such a list; the values of its numbers are not checked.
void read_yaml_text(const std::string& yaml, Footprint& footprint);

/// Distance of a point from the footprint, 0 inside.
double clearance_m(const Footprint& footprint, const Eigen::Vector2d& p_base_m);

/// Distance of the farthest corner from the base's origin.
double reach_m(const Footprint& footprint);

/// A vehicle with two driven wheels: its size, what it can do, and what it is sure to do. The defaults are those of a
/// Pioneer 3-DX (0.455 m by 0.381 m).
struct VehicleParams {
  Footprint footprint{{{0.215, 0.1905}, {-0.24, 0.1905}, {-0.24, -0.1905}, {0.215, -0.1905}}};
  double max_speed_m_s = 0.5;
  double max_turn_rate_rad_s = 1.0;
  double acceleration_m_s2 = 0.3;
  double slowing_m_s2 = 0.5;
  double braking_m_s2 = 1.0;
  double turn_acceleration_rad_s2 = 1.5;
  double reaction_s = 0.16;

  template <class Self, class Visit>
  static void fields(Self& self, Visit&& visit) {
    visit("footprint", self.footprint,
          "corners [x, y] in m of the vehicle's outline in the frame of its base, x ahead; convex, the origin inside");
    visit("max_speed_m_s", self.max_speed_m_s, Bounds{0.01, 20.0}, "m/s", "greatest speed");
    visit("max_turn_rate_rad_s", self.max_turn_rate_rad_s, Bounds{0.01, 20.0}, "rad/s", "greatest turn rate");
    visit("acceleration_m_s2", self.acceleration_m_s2, Bounds{0.01, 20.0}, "m/s^2", "greatest acceleration");
    visit("slowing_m_s2", self.slowing_m_s2, Bounds{0.01, 20.0}, "m/s^2", "usual deceleration");
    visit("braking_m_s2", self.braking_m_s2, Bounds{0.01, 20.0}, "m/s^2",
          "deceleration that the vehicle is sure to reach, at least the usual one");
    visit("turn_acceleration_rad_s2", self.turn_acceleration_rad_s2, Bounds{0.01, 100.0}, "rad/s^2",
          "greatest change of the turn rate");
    visit("reaction_s", self.reaction_s, Bounds{0.0, 2.0}, "s",
          "longest time from what happens until the vehicle begins to brake for it: from scan to scan, within a scan, "
          "and for computation, transmission and actuators");
  }

  /// Throws std::invalid_argument naming field and bound.
  void validate() const;
};

}  // namespace situation_awareness

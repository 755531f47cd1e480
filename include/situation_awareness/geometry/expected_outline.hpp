// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstdint>

#include "situation_awareness/geometry/box.hpp"
#include "situation_awareness/geometry/ellipse.hpp"

namespace situation_awareness {

/// Outline of a known object where it is expected: an ellipse or a box.
struct ExpectedOutline {
  ExpectedOutline() = default;
  ExpectedOutline(const Ellipse& known) : ellipse(known) {}  // NOLINT(google-explicit-constructor): surely an ellipse

  std::uint64_t id = 0;                                    ///< of the object, 0: none
  Ellipse ellipse;                                         ///< that stands for it: for a box that of equal moments
  Box box;                                                 ///< if p_box > 0
  double p_box = 0.0;                                      ///< probability that it is a box
  Eigen::Vector2d velocity_m_s = Eigen::Vector2d::Zero();  ///< in the frame of the outline, at the time of the outline
  double angular_velocity_rad_s = 0.0;
};

/// The outline `dt_s` later.
inline ExpectedOutline later(ExpectedOutline outline, double dt_s) {
  outline.ellipse.center_m += dt_s * outline.velocity_m_s;
  outline.box.center_m = outline.ellipse.center_m;
  outline.ellipse.psi_rad += dt_s * outline.angular_velocity_rad_s;
  outline.box.psi_rad += dt_s * outline.angular_velocity_rad_s;
  return outline;
}

}  // namespace situation_awareness

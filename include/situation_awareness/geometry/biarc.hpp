// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cmath>

#include <Eigen/Core>

#include "situation_awareness/geometry/angles.hpp"
#include "situation_awareness/geometry/pose2.hpp"

namespace situation_awareness {

/// Two arcs from pose to pose that share their tangent at the joint, in any frame. A curvature is positive to the left.
struct Biarc {
  Pose2 joint;
  double chord_m = 0.0;                       ///< of each of the two arcs
  double sweep0_rad = 0.0, sweep1_rad = 0.0;  ///< turn of the first and the second arc, left positive
  double curvature0_1pm = 0.0, curvature1_1pm = 0.0;
};

/// The biarc whose two chords have the same length. The poses differ in place. With both headings measured from the
/// chord and wrapped, it exists unless one is ahead of the other by 2 pi, and the S shape is included:
/// theta* = -(theta0 + theta1) / 2 is the heading at the joint, l = c / (2 cos((theta1 - theta0) / 4)) the chords'
/// length (the splinegon paper's eqs. 5 to 10 leave one angle free and exclude the S: docs/math/splinegons.md).
inline Biarc equal_chord_biarc(const Pose2& from, const Pose2& to) {
  const Eigen::Vector2d chord = to.translation_m - from.translation_m;
  const double chord_yaw_rad = std::atan2(chord.y(), chord.x());
  const double theta0_rad = wrap_to_pi(from.yaw_rad - chord_yaw_rad);
  const double theta1_rad = wrap_to_pi(to.yaw_rad - chord_yaw_rad);
  const double joint_rad = -0.5 * (theta0_rad + theta1_rad);
  Biarc biarc;
  biarc.chord_m = 0.5 * chord.norm() / std::cos(0.25 * (theta1_rad - theta0_rad));
  const double toward_rad = chord_yaw_rad + 0.5 * (theta0_rad + joint_rad);
  biarc.joint = {from.translation_m + biarc.chord_m * Eigen::Vector2d(std::cos(toward_rad), std::sin(toward_rad)),
                 chord_yaw_rad + joint_rad};
  biarc.sweep0_rad = joint_rad - theta0_rad;
  biarc.sweep1_rad = theta1_rad - joint_rad;
  biarc.curvature0_1pm = 2.0 * std::sin(0.5 * biarc.sweep0_rad) / biarc.chord_m;
  biarc.curvature1_1pm = 2.0 * std::sin(0.5 * biarc.sweep1_rad) / biarc.chord_m;
  return biarc;
}

}  // namespace situation_awareness

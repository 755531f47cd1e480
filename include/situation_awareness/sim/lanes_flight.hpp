// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstddef>
#include <optional>
#include <vector>

#include <Eigen/Core>

#include "situation_awareness/sim/guided_multirotor.hpp"

namespace situation_awareness {

/// A scripted flight in place of a mission: to and fro over a square around the world's origin, at the height at which
/// it begins, and back to where it began.
class LanesFlight {
 public:
  /// `multirotor` must outlive this. `half_region_m` is half of the square's edge, `lane_m` the greatest distance
  /// between two lanes; both positive.
  LanesFlight(GuidedMultirotor& multirotor, double half_region_m, double lane_m);

  /// Sets the goal. Call it several times per second of the simulation.
  void steer();

  /// It is back.
  bool done() const { return done_; }

 private:
  GuidedMultirotor& multirotor_;
  std::vector<Eigen::Vector2d> corners_;
  std::size_t corner_ = 0;
  std::optional<Eigen::Vector3d> begin_m_;
  bool done_ = false;
};

}  // namespace situation_awareness

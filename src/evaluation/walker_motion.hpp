// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <Eigen/Core>

#include "situation_awareness/evaluation/safety_transits.hpp"

namespace situation_awareness {

constexpr double kTick_s = 0.01;       ///< of a simulated transit
constexpr double kMoving_m_s = 0.001;  ///< a vehicle that is slower stands

/// Where a walker is, who goes back where a vehicle that stands is in the way.
class WalkerMotion {
 public:
  explicit WalkerMotion(const Walker& walker) : walker_(walker), pause_left_s_(walker.pause_s) {}

  Eigen::Vector2d center_m() const { return walker_.from_m + way_m_ * direction(); }

  /// Moves the walker on to the next tick.
  void advance(double time_s, const Pose2& T_world_base, double vehicle_m_s, const Footprint& footprint);

  /// Distance to its legs along a ray; infinite where there is none.
  double cast(const Eigen::Vector2d& from_m, const Eigen::Vector2d& u) const;

 private:
  Eigen::Vector2d direction() const { return (walker_.to_m - walker_.from_m).normalized(); }

  Walker walker_;
  double way_m_ = 0.0;
  double pause_left_s_ = 0.0;
  double waits_s_ = 0.0;
  bool goes_back_ = false;
};

}  // namespace situation_awareness

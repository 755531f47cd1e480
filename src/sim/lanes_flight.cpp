// SPDX-License-Identifier: BSD-3-Clause
#include "situation_awareness/sim/lanes_flight.hpp"

#include <cmath>

namespace situation_awareness {
namespace {

constexpr double kThere_m = 6.0;  ///< so near to a corner the next one is the goal

}  // namespace

LanesFlight::LanesFlight(GuidedMultirotor& multirotor, double half_region_m, double lane_m) : multirotor_(multirotor) {
  const int count = static_cast<int>(std::ceil(2.0 * half_region_m / lane_m)) + 1;
  for (int i = 0; i < count; ++i) {
    const double y = -half_region_m + 2.0 * half_region_m * i / (count - 1);
    const double begin = i % 2 == 0 ? -half_region_m : half_region_m;
    corners_.emplace_back(begin, y);
    corners_.emplace_back(-begin, y);
  }
}

void LanesFlight::steer() {
  const Eigen::Vector3d p_m = multirotor_.at(multirotor_.time_s()).T_world_robot.translation();
  if (!begin_m_) begin_m_ = p_m;
  const bool is_home = corner_ >= corners_.size();
  const Eigen::Vector2d goal_m = is_home ? Eigen::Vector2d(begin_m_->head<2>()) : corners_[corner_];
  const Eigen::Vector2d to_goal_m = goal_m - p_m.head<2>();
  if (to_goal_m.norm() < kThere_m) {
    done_ = done_ || is_home;
    if (!is_home) ++corner_;
    return;
  }
  multirotor_.go_to({goal_m.x(), goal_m.y(), begin_m_->z()}, std::atan2(to_goal_m.y(), to_goal_m.x()));
}

}  // namespace situation_awareness

// SPDX-License-Identifier: BSD-3-Clause
#include "walker_motion.hpp"

#include <algorithm>
#include <cmath>
#include <limits>

#include "situation_awareness/geometry/angles.hpp"

namespace situation_awareness {
namespace {

constexpr double kStride_m = 0.12;  // of a leg, ahead and behind
constexpr double kHips_m = 0.08;    // of a leg, to the side
constexpr double kBlocked_s = 1.0;  // a walker in front of a vehicle that stands waits so long, and goes back

double cast_circle(const Eigen::Vector2d& center_m, double radius_m, const Eigen::Vector2d& from_m,
                   const Eigen::Vector2d& u) {
  const Eigen::Vector2d to_m = center_m - from_m;
  const double along_m = u.dot(to_m), across_m = u.x() * to_m.y() - u.y() * to_m.x();
  const double half2_m2 = radius_m * radius_m - across_m * across_m;
  if (half2_m2 <= 0.0 || along_m <= 0.0) return std::numeric_limits<double>::infinity();
  return along_m - std::sqrt(half2_m2);
}

}  // namespace

void WalkerMotion::advance(double time_s, const Pose2& T_world_base, double vehicle_m_s, const Footprint& footprint) {
  if (time_s < walker_.begin_s) return;
  if (waits_s_ > 0.0) {
    waits_s_ -= kTick_s;
    if (waits_s_ <= 0.0) goes_back_ = true;
    return;
  }
  if (way_m_ >= walker_.pause_at_m && pause_left_s_ > 0.0 && !goes_back_) {
    pause_left_s_ -= kTick_s;
    return;
  }
  const double length_m = (walker_.to_m - walker_.from_m).norm();
  const double step_m = walker_.speed_m_s * kTick_s;
  const double next_m = std::clamp(way_m_ + (goes_back_ ? -step_m : step_m), 0.0, length_m);
  const Eigen::Vector2d p_base_m = inverse(T_world_base) * (walker_.from_m + next_m * direction());
  const bool is_blocked = clearance_m(footprint, p_base_m) <= Walker::kRadius_m + 0.01;
  if (is_blocked && std::abs(vehicle_m_s) <= kMoving_m_s) {
    if (!goes_back_) waits_s_ = kBlocked_s;
    return;
  }
  way_m_ = next_m;
}

double WalkerMotion::cast(const Eigen::Vector2d& from_m, const Eigen::Vector2d& u) const {
  const Eigen::Vector2d ahead = direction(), aside(-ahead.y(), ahead.x());
  const double stride_m = kStride_m * std::sin(way_m_ * kPi / 0.7);
  double range_m = std::numeric_limits<double>::infinity();
  for (const double leg : {-1.0, 1.0}) {
    const Eigen::Vector2d leg_m = center_m() + leg * (stride_m * ahead + kHips_m * aside);
    range_m = std::min(range_m, cast_circle(leg_m, Walker::kLegRadius_m, from_m, u));
  }
  return range_m;
}

}  // namespace situation_awareness

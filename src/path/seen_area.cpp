// SPDX-License-Identifier: BSD-3-Clause
#include "situation_awareness/path/seen_area.hpp"

#include <algorithm>
#include <cmath>

#include "situation_awareness/geometry/angles.hpp"

namespace situation_awareness {
namespace {

/// m. Between points of a path that are looked up; obstacles are checked without such points (avoidance.hpp).
constexpr double kSeenStep_m = 1.0;
/// rad. A scanner that turned by so much sees something else from the same place.
constexpr double kTurned_rad = 0.2;

bool sees(const FreeBeams& sight, const Eigen::Vector2d& p_world_m) {
  const Eigen::Vector2d way = p_world_m - sight.T_world_sensor.translation_m;
  const double distance_m = way.norm();
  if (sight.free_m.size() < 2) return false;
  double angle_rad =
      std::remainder(std::atan2(way.y(), way.x()) - sight.T_world_sensor.yaw_rad - sight.from_rad, 2.0 * kPi);
  if (angle_rad < 0.0) angle_rad += 2.0 * kPi;
  const double beam = std::floor(angle_rad / sight.step_rad);
  if (beam + 1.0 >= static_cast<double>(sight.free_m.size())) return false;
  const auto i = static_cast<std::size_t>(beam);
  return distance_m < std::min(sight.free_m[i], sight.free_m[i + 1]);
}

}  // namespace

void SeenArea::clear() {
  used_ = latest_ = 0;
  start_radius_m_ = 0.0;
}

void SeenArea::set_start(const Eigen::Vector2d& center_m, double radius_m) {
  start_m_ = center_m;
  start_radius_m_ = radius_m;
}

void SeenArea::add(const FreeBeams& sight) {
  // The latest one is replaced until the one before is far enough.
  if (used_ >= 2) {
    const Pose2& before = sights_[(latest_ + sights_.size() - 1) % sights_.size()].T_world_sensor;
    const Pose2& latest = sights_[latest_].T_world_sensor;
    if ((latest.translation_m - before.translation_m).norm() > spacing_m_ ||
        std::abs(wrap_to_pi(latest.yaw_rad - before.yaw_rad)) > kTurned_rad) {
      latest_ = (latest_ + 1) % sights_.size();
      used_ = std::min(used_ + 1, sights_.size());
    }
  } else {
    latest_ = used_++;
    latest_ = std::min(latest_, sights_.size() - 1);
    used_ = std::min(used_, sights_.size());
  }
  FreeBeams& kept = sights_[latest_];
  kept.T_world_sensor = sight.T_world_sensor;
  kept.from_rad = sight.from_rad;
  kept.step_rad = sight.step_rad;
  kept.free_m.assign(sight.free_m.begin(), sight.free_m.end());
}

bool SeenArea::contains(const Eigen::Vector2d& p_world_m) const {
  if ((p_world_m - start_m_).squaredNorm() < start_radius_m_ * start_radius_m_) return true;
  for (std::size_t i = 0; i < used_; ++i) {
    if (sees(sights_[(latest_ + sights_.size() - i) % sights_.size()], p_world_m)) return true;
  }
  return false;
}

bool SeenArea::contains(const SegmentPath& path, double from_m, double to_m, double half_width_m) const {
  const auto steps = static_cast<std::size_t>(std::max(1.0, std::ceil((to_m - from_m) / kSeenStep_m)));
  for (std::size_t i = 0; i <= steps; ++i) {
    const double part = static_cast<double>(i) / static_cast<double>(steps);
    const Pose2 pose = place_at(path, from_m + part * (to_m - from_m)).pose;
    for (const double offset_m : {0.0, half_width_m, -half_width_m}) {
      if (!contains(pose * Eigen::Vector2d(0.0, offset_m))) return false;
    }
  }
  return true;
}

}  // namespace situation_awareness

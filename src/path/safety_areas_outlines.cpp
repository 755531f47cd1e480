// SPDX-License-Identifier: BSD-3-Clause
// The outlines of the areas, for display.
#include "situation_awareness/path/safety_areas.hpp"

#include <algorithm>
#include <cmath>
#include <utility>

#include <Eigen/Geometry>

namespace situation_awareness {
/// Frames along the way, from behind the vehicle to ahead of where it stops.
void SafetyAreas::make_frames() {
  const double beyond_m = reach_m_ + margins_.protective_m + warning_margin_m(full_speed_m_s_);
  const auto beyond = static_cast<std::size_t>(std::ceil(beyond_m / kStep_m)) + 1;
  frames_.clear();
  for (std::size_t i = beyond; i > 0; --i) {
    frames_.emplace_back(T_world_base_ * Pose2{{-kStep_m * static_cast<double>(i), 0.0}, 0.0});
  }
  first_frame_ = frames_.size();
  frames_.insert(frames_.end(), steps_.begin(), steps_.end());
  const Pose2 last = steps_.back().pose;
  for (std::size_t i = 1; i <= beyond; ++i) {
    frames_.emplace_back(last * Pose2{{kStep_m * static_cast<double>(i), 0.0}, 0.0});
  }
}

/// The outline of what the footprint sweeps on a way, with a margin, by its widths to the left and to the right of each
/// frame.
void SafetyAreas::sweep(double way_m, double margin_m, std::vector<Eigen::Vector2d>& polygon_world_m) {
  const std::size_t count = frames_.size();
  left_m_.assign(count, -kNoLimit);
  right_m_.assign(count, -kNoLimit);
  const auto swept = std::min(steps_.size(), static_cast<std::size_t>(std::ceil(way_m / kStep_m)) + 1);
  std::size_t first = count, last = 0;
  for (std::size_t k = 0; k < swept; ++k) {
    for (const Eigen::Vector2d& rim_m : rim_m_) {
      const Eigen::Vector2d p_world_m = steps_[k].to_world(rim_m);
      const auto guess = static_cast<std::ptrdiff_t>(first_frame_ + k) + std::lround(rim_m.x() / kStep_m);
      std::size_t nearest = 0;
      double nearest_m2 = kNoLimit;
      for (std::ptrdiff_t i = guess - 2; i <= guess + 2; ++i) {
        const auto j =
            static_cast<std::size_t>(std::clamp<std::ptrdiff_t>(i, 0, static_cast<std::ptrdiff_t>(count) - 1));
        const double d_m2 = (frames_[j].pose.translation_m - p_world_m).squaredNorm();
        if (d_m2 < nearest_m2) {
          nearest_m2 = d_m2;
          nearest = j;
        }
      }
      const double across_m = frames_[nearest].to_base(p_world_m).y();
      left_m_[nearest] = std::max(left_m_[nearest], across_m);
      right_m_[nearest] = std::max(right_m_[nearest], -across_m);
      first = std::min(first, nearest);
      last = std::max(last, nearest);
    }
  }
  for (std::size_t i = first + 1; i <= last; ++i) {
    if (left_m_[i] == -kNoLimit) left_m_[i] = left_m_[i - 1];
    if (right_m_[i] == -kNoLimit) right_m_[i] = right_m_[i - 1];
  }
  const auto widen = [&](const std::vector<double>& widths_m, double by_m, std::vector<double>& wide_m) {
    wide_m.assign(count, -kNoLimit);
    const auto reach = static_cast<std::size_t>(by_m / kStep_m);
    for (std::size_t i = first; i <= last; ++i) {
      for (std::size_t j = i > reach ? i - reach : 0; j <= std::min(i + reach, count - 1); ++j) {
        const double along_m = kStep_m * (static_cast<double>(j) - static_cast<double>(i));
        wide_m[j] = std::max(wide_m[j], widths_m[i] + std::sqrt(std::max(by_m * by_m - along_m * along_m, 0.0)));
      }
    }
  };
  widen(left_m_, margin_m, wide_left_m_);
  widen(right_m_, margin_m, wide_right_m_);
  if (decision_.policy == SafetyPolicy::kUpdated) {
    widen(left_m_, margins_.floor_m, floor_left_m_);
    widen(right_m_, margins_.floor_m, floor_right_m_);
    shrink(wide_left_m_, 1.0, floor_left_m_);
    shrink(wide_right_m_, -1.0, floor_right_m_);
  }
  polygon_world_m.clear();
  const auto is_in = [&](std::size_t j) { return wide_left_m_[j] + wide_right_m_[j] > 0.0; };  // false for -infinity
  for (std::size_t j = 0; j < count; ++j) {
    if (is_in(j)) polygon_world_m.emplace_back(frames_[j].to_world({0.0, -wide_right_m_[j]}));
  }
  for (std::size_t j = count; j-- > 0;) {
    if (is_in(j)) polygon_world_m.emplace_back(frames_[j].to_world({0.0, wide_left_m_[j]}));
  }
}

/// Widths on one side (1: left, -1: right) up to the known chains there, but never less than those of the hard floor.
void SafetyAreas::shrink(std::vector<double>& widths_m, double side, const std::vector<double>& least_m) const {
  for (const Edge& edge : edges_) {
    if (edge.weight != Weight::kKnown || !edge.explains) continue;
    for (std::size_t j = 0; j < frames_.size(); ++j) {
      if (widths_m[j] == -kNoLimit) continue;
      // Of the edge, the part beside this frame: at most half a step ahead and behind.
      const Eigen::Vector2d from_m = frames_[j].to_base(edge.from_m), to_m = frames_[j].to_base(edge.to_m);
      const double ahead_m = to_m.x() - from_m.x();
      double low = 0.0, high = 1.0;
      if (std::abs(ahead_m) < 1e-9) {
        if (std::abs(from_m.x()) > 0.5 * kStep_m) continue;
      } else {
        const double a = (-0.5 * kStep_m - from_m.x()) / ahead_m, b = (0.5 * kStep_m - from_m.x()) / ahead_m;
        low = std::max(low, std::min(a, b));
        high = std::min(high, std::max(a, b));
        if (low > high) continue;
      }
      const double y1_m = side * (from_m.y() + low * (to_m.y() - from_m.y()));
      const double y2_m = side * (from_m.y() + high * (to_m.y() - from_m.y()));
      const double nearest_m = std::min(y1_m, y2_m);
      if (std::max(y1_m, y2_m) < 0.0) continue;  // on the other side
      const double floor_m = std::max(least_m[j], 0.0);
      widths_m[j] = std::max(std::min(widths_m[j], nearest_m - edge.reach_m), floor_m);
    }
  }
}

}  // namespace situation_awareness

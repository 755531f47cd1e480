// SPDX-License-Identifier: BSD-3-Clause
#include "situation_awareness/map/free_space_memory.hpp"

#include <algorithm>
#include <cmath>
#include <cstddef>

#include "situation_awareness/common/time.hpp"
#include "situation_awareness/geometry/angles.hpp"

namespace situation_awareness {

void FreeSpaceMemory::add(std::int64_t stamp_ns, const Pose2& T_world_level, const FreeSpace& free_space) {
  if (free_space.azimuth_rad.size() < 2) return;
  if (stamp_ns < latest_ns_) clear();
  if (!scans_.empty() && seconds_between(latest_ns_, stamp_ns) < step_s_) return;
  latest_ns_ = stamp_ns;
  if (scans_.size() < most_) scans_.emplace_back();
  Remembered& scan = scans_[next_];
  next_ = (next_ + 1) % most_;
  scan.stamp_ns = stamp_ns;
  scan.T_level_world = inverse(T_world_level);
  scan.free_space = free_space;
}

void FreeSpaceMemory::clear() {
  scans_.clear();
  next_ = 0;
}

/// Whether all beams go on behind a place that are no farther beside it than the margin, and the next ones.
bool FreeSpaceMemory::passes(const Remembered& scan, const Eigen::Vector2d& p_world_m) {
  const std::vector<float>& azimuth_rad = scan.free_space.azimuth_rad;
  const std::vector<float>& range_m = scan.free_space.range_m;
  const auto beams = static_cast<std::ptrdiff_t>(azimuth_rad.size());
  const Eigen::Vector2d p_level_m = scan.T_level_world * p_world_m;
  const double distance_m = p_level_m.norm();
  if (distance_m <= kMargin_m) return false;
  const double first_rad = azimuth_rad.front();
  double place_rad = first_rad + wrap_to_pi(std::atan2(p_level_m.y(), p_level_m.x()) - first_rad);
  if (place_rad < first_rad) place_rad += 2.0 * kPi;
  const auto first_from = [&](double from_rad) {
    return std::lower_bound(azimuth_rad.begin(), azimuth_rad.end(), static_cast<float>(from_rad)) - azimuth_rad.begin();
  };
  const double half_rad = std::asin(kMargin_m / distance_m);
  const std::ptrdiff_t end = first_from(place_rad + half_rad);
  for (std::ptrdiff_t i = first_from(place_rad - half_rad) - 1; i <= end; ++i) {
    if ((i < 0 || i >= beams) && !scan.free_space.full_circle) return false;
    if (static_cast<double>(range_m[static_cast<std::size_t>((i + beams) % beams)]) <= distance_m + kMargin_m)
      return false;
  }
  return true;
}

bool FreeSpaceMemory::passes_half(const Remembered& scan, const std::vector<Eigen::Vector2d>& places_world_m) {
  const std::size_t most_missed = places_world_m.size() / 2;
  std::size_t missed = 0;
  for (const Eigen::Vector2d& p_world_m : places_world_m) {
    if (!passes(scan, p_world_m) && ++missed > most_missed) return false;
  }
  return !places_world_m.empty();
}

std::optional<std::int64_t> FreeSpaceMemory::last_free_ns(const std::vector<Eigen::Vector2d>& places_world_m,
                                                          std::int64_t before_ns) const {
  for (std::size_t back = 1; back <= scans_.size(); ++back) {
    const Remembered& scan = latest(back);
    if (scan.stamp_ns < before_ns && passes_half(scan, places_world_m)) return scan.stamp_ns;
  }
  return std::nullopt;
}

std::optional<std::int64_t> FreeSpaceMemory::first_free_ns(const std::vector<Eigen::Vector2d>& places_world_m,
                                                           std::int64_t after_ns) const {
  std::optional<std::int64_t> first_ns;
  for (std::size_t back = 1; back <= scans_.size(); ++back) {
    const Remembered& scan = latest(back);
    if (scan.stamp_ns <= after_ns) break;
    if (passes_half(scan, places_world_m)) first_ns = scan.stamp_ns;
  }
  return first_ns;
}

}  // namespace situation_awareness

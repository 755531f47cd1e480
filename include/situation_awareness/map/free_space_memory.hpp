// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstddef>
#include <cstdint>
#include <limits>
#include <optional>
#include <vector>

#include <Eigen/Core>

#include "situation_awareness/geometry/pose2.hpp"
#include "situation_awareness/points/points.hpp"

namespace situation_awareness {

/// The free space of earlier scans, by which it is known when a place was last seen to be free.
class FreeSpaceMemory {
 public:
  static constexpr double kStep_s = 0.5;
  static constexpr std::size_t kScans = 240;
  /// A beam that passes a place so near beside it, or ends so near to it, may not be of that place: by the noise of
  /// ranges and of poses.
  static constexpr double kMargin_m = 0.15;

  /// One scan is kept in `step_s`, and the latest `scans` of these, at least one.
  explicit FreeSpaceMemory(double step_s = kStep_s, std::size_t scans = kScans) : step_s_(step_s), most_(scans) {}

  /// A scan, later than those before: one that is earlier begins anew. The memory of the oldest one is reused.
  void add(std::int64_t stamp_ns, const Pose2& T_world_level, const FreeSpace& free_space);

  /// Stamp of the latest of the scans before `before_ns` of which beams pass at least half of these places: what has
  /// them on its outline was not there. None: no scan that is remembered saw that.
  std::optional<std::int64_t> last_free_ns(const std::vector<Eigen::Vector2d>& places_world_m,
                                           std::int64_t before_ns) const;

  /// Stamp of the first of the scans after `after_ns` of which that is true.
  std::optional<std::int64_t> first_free_ns(const std::vector<Eigen::Vector2d>& places_world_m,
                                            std::int64_t after_ns) const;

  /// Forgets all scans.
  void clear();

 private:
  struct Remembered {
    std::int64_t stamp_ns = 0;
    Pose2 T_level_world;
    FreeSpace free_space;
  };

  /// The one that was added as the `back`-th from the latest, which is the first.
  const Remembered& latest(std::size_t back) const { return scans_[(next_ + most_ - back) % most_]; }
  static bool passes(const Remembered& scan, const Eigen::Vector2d& p_world_m);
  static bool passes_half(const Remembered& scan, const std::vector<Eigen::Vector2d>& places_world_m);

  double step_s_;
  std::size_t most_;
  std::vector<Remembered> scans_;  ///< a ring, `next_` is the oldest once it is full
  std::size_t next_ = 0;
  std::int64_t latest_ns_ = std::numeric_limits<std::int64_t>::min();
};

}  // namespace situation_awareness

// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstddef>
#include <cstdint>
#include <vector>

#include <Eigen/Core>

#include "situation_awareness/path/obstacles.hpp"
#include "situation_awareness/path/seen_area.hpp"

namespace situation_awareness {

/// What the beams of the latest scans ended at and no map knows, as pieces of outlines: from each hit to the next one
/// that is near to it; of a hit alone, as wide as the beams are apart there. A slim thing far away is hit by a few
/// scans only, and what is behind the scanner by none: so a piece is remembered for a while, until a scan hits it
/// again, or shows from so near that nothing is there that it could not miss it. Keeps its memory: no allocation after
/// warm-up.
class HitMemory {
 public:
  static constexpr std::size_t kMost = 1024;  ///< pieces; the oldest are forgotten for others
  static constexpr double kKept_s = 20.0;     ///< more than a turn around takes, after which it is in sight again
  static constexpr double kOnMap_m = 0.7;     ///< what is so near to something is on that
  static constexpr double kSigma_m = 0.05;    ///< standard deviation of a hit

  HitMemory();

  /// A scan. Hits farther than `reach_m` from the scanner are left out.
  void add(const FreeBeams& sight, double reach_m, std::int64_t now_ns);

  /// Adds them to obstacles, which are those of the maps until then: pieces that are on these are not added, and
  /// forgotten if `maps_count`.
  void add_to(Obstacles& obstacles, std::int64_t now_ns, bool maps_count);

  void clear() { pieces_.clear(); }
  std::size_t size() const { return pieces_.size(); }

 private:
  struct Piece {
    Eigen::Vector2d from_m, to_m;  ///< in the world
    std::int64_t seen_ns;
  };

  std::vector<Piece> pieces_, kept_;
  std::vector<std::size_t> off_map_;
  std::vector<Eigen::Vector2d> run_m_;
};

}  // namespace situation_awareness

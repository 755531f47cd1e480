// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstdint>
#include <limits>
#include <string>

#include "situation_awareness/points/points.hpp"

namespace situation_awareness {

/// Numbers of points by state over scans, to tell why nothing can be mapped by them. A map needs one hit of interest at
/// least: a room without anything in it has its walls.
class PointStates {
 public:
  /// Points of a scan, limited or not.
  void add(const Points& points);

  /// Why nothing can be mapped by the scans so far, in one sentence; empty if something can, and without scans.
  std::string why_no_hit() const;

  std::uint64_t scans() const { return scans_; }

 private:
  std::uint64_t scans_ = 0, hits_ = 0, outside_ = 0, free_ = 0, too_close_ = 0, invalid_ = 0;
  double nearest_m_ = std::numeric_limits<double>::infinity(), farthest_m_ = 0.0;  ///< of those outside
};

}  // namespace situation_awareness

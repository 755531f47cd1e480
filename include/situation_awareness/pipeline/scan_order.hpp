// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>

#include "situation_awareness/geometry/pose2.hpp"
#include "situation_awareness/points/points.hpp"
#include "situation_awareness/pose/key_scan.hpp"

namespace situation_awareness {

/// In which order the beams of a scanner are measured, found while it turns: in the wrong order a scan is bent the more
/// the faster the scanner turns, so that scans taken at other rates, or on the other side of its seam, do not fit onto
/// it. Poses are needed for the motion within a scan alone; their errors and times matter little.
///
/// Time and memory per scan are bounded; no allocation after warm-up.
class ScanOrderEstimator {
 public:
  enum class Order { kUnknown, kAsSaid, kReversed };

  /// Adds a scan, projected as it says that its beams are measured, and in the reverse order
  /// (project_horizontally with its two poses exchanged).
  void add(const Points& as_said, const Points& reversed);

  /// It stays as it is once it is known.
  Order order() const { return order_; }

 private:
  /// A key scan and those after it, by one order.
  struct Matched {
    KeyScan key;
    Pose2 T_key_level, T_world_level;  ///< of the latest scan
  };

  void add_turn(const std::array<const Points*, 2>& both);
  void compare(std::array<ScanMatch, 2>& both);
  void begin_window(const std::array<const Points*, 2>& both);
  void finish_window();

  std::array<Matched, 2> matched_;  ///< as said, reversed
  bool has_key_ = false;
  std::int64_t key_ns_ = 0, latest_ns_ = 0;
  double gain_m2_ = 0.0;        ///< sum over the window
  double difference_m2_ = 0.0;  ///< the same
  int scans_ = 0;               ///< in it
  double most_turn_rad_ = 0.0;  ///< within a sweep of it
  std::size_t windows_ = 0;
  double gain_m2_sum_ = 0.0, difference_m2_sum_ = 0.0;                       ///< of the windows
  double gain2_m4_ = 0.0, gain_difference_m4_ = 0.0, difference2_m4_ = 0.0;  ///< sums of their products
  Order order_ = Order::kUnknown;
};

}  // namespace situation_awareness

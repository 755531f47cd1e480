// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <vector>

#include "situation_awareness/path/chain_view.hpp"
#include "situation_awareness/points/points.hpp"

namespace situation_awareness {

/// Finds a driver that repeats a scan with new stamps: all ranges are bit for bit those before, in three scans in a
/// row. Of a scanner that has shown noise this is enough; without noise, as of a simulator, a vehicle that stands sees
/// the same again, so what it sees must have moved with the vehicle; once it has, the scan repeats itself until it
/// changes, or for some seconds, longer each time. Where fewer than 20 beams return nothing is said,
/// for an empty place looks the same again. No allocation after warm-up.
class RepeatedScans {
 public:
  /// Whether the latest scan repeats those before. `ranges_m`: of the beams of `points`, as the driver gave them.
  bool add(const std::vector<float>& ranges_m, const Points& points);

  bool is_noisy() const { return noisy_scans_ >= kNoisyScans; }

 private:
  static constexpr int kNoisyScans = 3;

  void look_for_noise(const std::vector<float>& ranges_m);
  bool has_moved_along(const Points& points) const;

  std::vector<float> before_m_;
  Points first_;  ///< of those that are alike
  std::int64_t repeats_ = 0, renewed_after_ = 0, renewed_at_ = 0;
  bool is_found_ = false;
  int noisy_scans_ = 0;
};

/// Finds a scanner that does not see what is there, in a quarter (ahead, left, behind or right) or in all:
///
/// - It has not been shown to see: in no scan had a twentieth of its beams a return. An empty place looks the same.
/// - Of the beams that chains of the map are in the way of, half pass through them, or 0.8 of a quarter of them;
///   through two chains at least, or one that is larger than what can be taken away. Chains that the map did not see of
///   late, as those of a file, count in a quarter that has not been shown to see.
/// - Of the returns of the scan before, as many have none at once, over more than what can be taken away.
///
/// Where beams have no return, it stays so until half of them have one again, however the map changes meanwhile. After
/// a gap in its scans, or a jump of time, it has to be shown again that the scanner sees.
class BlindScanner {
 public:
  /// Whether the scanner may be blind. `view` is of the points.
  bool add(const Points& points, const ChainView& view, double base_yaw_rad);

  /// Whether a scan has shown it.
  bool has_seen() const { return has_seen_.back(); }

  /// Whether one has shown it of the quarter ahead.
  bool has_seen_ahead() const { return has_seen_.front(); }

 private:
  static constexpr std::size_t kAll = 4, kSectors = 5;  // quarters, and all

  std::array<std::size_t, kSectors> needed_hits_{};  ///< until it sees again; 0: it does
  std::array<bool, kSectors> has_seen_{};
  std::vector<Point> before_;  ///< of the scan before; none: there is none
  std::int64_t before_ns_ = 0;
};

}  // namespace situation_awareness

// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include <Eigen/Geometry>

#include "situation_awareness/pipeline/scan_order.hpp"
#include "situation_awareness/points/points.hpp"
#include "situation_awareness/pose/pose_offset.hpp"
#include "situation_awareness/scan/scan.hpp"
#include "situation_awareness/scan/scanner_params.hpp"

namespace situation_awareness {

/// Whether a driver fills its messages as `scan` says that it does, by what they show while the scanner turns. Nothing
/// is changed: a value of "invalid" that is taken for "nothing there" would remove what stands from the map, and a
/// drive that is too short to be sure would be mapped in two ways.
class ScannerCheck {
 public:
  /// `used_offset_s`: scan_pose_offset_s as it is used.
  ScannerCheck(const ScannerParams& scanner, double used_offset_s);

  /// The ranges of a message, by the convention of `scanner`.
  void add_ranges(const std::vector<float>& ranges, float range_max_m);

  /// The scan of that message, limited to what is of interest, its points, and the poses of the lidar at its first and
  /// last beam: the same where the scan was made of a cloud, whose points were put where they were seen.
  void add(const Scan& scan, const Points& points, const Eigen::Isometry3d& T_world_lidar,
           const Eigen::Isometry3d& T_world_lidar_end);

  /// By the order of beams that fits.
  const PoseOffsetEstimator& pose_offset() const;

  /// To set scan/beam_order or scan/stamp_at, a sentence each, where the motion has shown that they are not so.
  std::vector<std::string> advice() const;

  /// Whether scan_pose_offset_s is to be set: scans and poses are out of step, and not by scan/stamp_at.
  bool is_out_of_step() const;

  /// What says "nothing there": "61 % of the beams", or a proposal of scan/no_return where none does, but other beams
  /// have no range.
  std::string no_return_text() const;
  /// The proposal of scan/no_return alone; empty if there is none.
  std::string no_return_advice() const;

 private:
  std::string stamp_at_that_fits() const;

  ScannerParams scanner_;
  PoseOffsetEstimator as_said_, reversed_;
  ScanOrderEstimator order_;
  Points reversed_points_;
  double sweep_s_ = 0.0;              ///< of the latest scan
  bool has_moved_in_scan_ = false;    ///< in any; the scans of clouds have no motion in them any more
  std::uint64_t scans_of_order_ = 0;  ///< by which the order of beams was looked for
  std::uint64_t scans_ = 0, beams_ = 0, nothing_ = 0, zero_ = 0, nan_ = 0;
};

}  // namespace situation_awareness

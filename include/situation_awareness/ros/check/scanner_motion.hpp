// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include <Eigen/Geometry>

#include "situation_awareness/points/points.hpp"
#include "situation_awareness/pose/key_scan.hpp"
#include "situation_awareness/ros/check/report.hpp"
#include "situation_awareness/scan/scan.hpp"

namespace situation_awareness {

/// What the poses of a scanner say of its motion.
class ScannerMotion {
 public:
  void add(const Scan& scan, const Eigen::Isometry3d& T_world_lidar);

  /// Appends to the facts and findings; `period_s`: from scan to scan.
  void report(const std::string& topic, double period_s, std::vector<std::string>& facts,
              std::vector<Finding>& findings) const;

 private:
  bool has_times_ = false;  ///< of the beams of the latest scan
  std::optional<std::int64_t> stamp_ns_;
  Eigen::Isometry3d T_world_lidar_;
  double way_m_ = 0.0, turned_rad_ = 0.0, speed_m_s_ = 0.0, rate_rad_s_ = 0.0;
};

/// Whether a scanner of which nothing says where it is stands still, by what it sees: scans are matched with an earlier
/// one.
class StandingScanner {
 public:
  void add(const Scan& scan);

  /// Appends to the findings if it does not.
  void report(const std::string& topic, std::vector<Finding>& findings) const;

 private:
  KeyScan key_;
  Points points_;
  bool has_key_ = false;
  Pose2 T_first_key_, T_key_scan_;
  double largest_m_ = 0.0, largest_rad_ = 0.0;  ///< from the first scan
};

}  // namespace situation_awareness

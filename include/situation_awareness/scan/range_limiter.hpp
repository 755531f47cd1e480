// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <string>
#include <vector>

#include <Eigen/Geometry>

#include "situation_awareness/common/params.hpp"
#include "situation_awareness/scan/scan.hpp"
#include "situation_awareness/scan/scanner_params.hpp"

namespace situation_awareness {

/// Half-space of the world: points p with normal_world . p <= offset_m are inside.
struct HalfSpace {
  Eigen::Vector3d normal_world = Eigen::Vector3d::UnitX();
  double offset_m = 0.0;
};

/// A volume as YAML text, [[nx, ny, nz, offset_m], ...], that is read back exactly.
std::string yaml_text(const std::vector<HalfSpace>& volume);

/// Throws std::invalid_argument if the text is not such a list; the values of its numbers are not checked.
void read_yaml_text(const std::string& yaml, std::vector<HalfSpace>& volume);

/// Range and volume of interest, and how the driver fills its messages: the section `scan`.
struct RangeLimiterParams {
  double min_range_m = 0.1;
  double max_range_m = 10.0;
  /// Convex volume of interest, the intersection of these half-spaces; empty means everywhere.
  std::vector<HalfSpace> volume;
  ScannerParams scanner;

  template <class Self, class Visit>
  static void fields(Self& self, Visit&& visit) {
    visit("min_range_m", self.min_range_m, Bounds{0.0, 1000.0}, "m",
          "hits nearer than this are classified as too close", kLive);
    visit("max_range_m", self.max_range_m, Bounds{0.0, 1000.0}, "m",
          "hits farther than this are outside the range of interest", kLive);
    visit("volume", self.volume,
          "convex volume of interest in the world frame: half-spaces [nx, ny, nz, offset_m] with n . p <= offset_m; "
          "empty: everywhere",
          kLive);
    ScannerParams::fields(self.scanner, visit);
  }

  /// Throws std::invalid_argument naming field and bound.
  void validate() const;
};

/// Limit a scan to the range and the volume of interest (circle paper, Sect. III-A, eq. 4).
///
/// Hits outside become kOutside and keep their range: they still occlude the space behind them, and the space before
/// them is free. Hits nearer than min_range_m become kTooClose.
///
/// `memory` is a scan no longer needed, whose memory the result reuses: no allocation after warm-up. Later stages do
/// the same.
Scan limit_range(const Scan& scan, const Eigen::Isometry3d& T_world_lidar, const RangeLimiterParams& params,
                 Scan memory = {});

}  // namespace situation_awareness

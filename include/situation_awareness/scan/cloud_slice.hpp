// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstddef>
#include <cstdint>
#include <optional>

#include <Eigen/Geometry>

#include "situation_awareness/cloud/cloud.hpp"
#include "situation_awareness/common/params.hpp"
#include "situation_awareness/scan/scan.hpp"

namespace situation_awareness {

/// Which slice of a cloud is taken for a scan.
struct CloudSliceParams {
  double min_height_m = -0.3;
  double max_height_m = 0.3;
  double min_range_m = 0.1;
  double max_range_m = 12.0;
  double angle_increment_rad = 0.006981317;  // 0.4 degrees
  double max_depth_m = 0.05;

  template <class Self, class Visit>
  static void fields(Self& self, Visit&& visit) {
    visit("min_height_m", self.min_height_m, Bounds{-100.0, -0.001}, "m",
          "lower edge of the slice of the cloud that makes the scan, from the sensor, upwards", kLive);
    visit("max_height_m", self.max_height_m, Bounds{0.001, 100.0}, "m", "upper edge of the slice", kLive);
    visit("min_range_m", self.min_range_m, Bounds{0.0, 1000.0}, "m", "nearer returns are ignored: the robot itself");
    visit("max_range_m", self.max_range_m, Bounds{0.01, 1000.0}, "m",
          "horizontal range of the scan, beyond scan.max_range_m by the extent of an object; a bearing is free if a "
          "measurement stays in the slice this far");
    visit("angle_increment_rad", self.angle_increment_rad, Bounds{0.0005, 0.2}, "rad",
          "bearing from beam to beam of the scan; not less than that from column to column of the sensor", kLive);
    visit("max_depth_m", self.max_depth_m, Bounds{0.0, 10.0}, "m",
          "returns at one bearing within this distance behind the nearest are of the same surface and averaged; about "
          "five times the range noise",
          kLive);
  }

  /// Throws std::invalid_argument naming field and bound.
  void validate() const;
};

/// When the first and the last measurement of a cloud were taken, after its stamp.
struct CloudTimes {
  double first_s = 0.0;
  double last_s = 0.0;
};

/// Of the times that are known (not NaN). None if none is, or one is more than a second from the stamp. Both 0 for a
/// cloud without points.
std::optional<CloudTimes> times_of(const Cloud& cloud);

/// A scan in a level frame: origin at the sensor when it took the first measurement, z up, x the sensor's x axis turned
/// into the horizontal plane. The stamp is the time of the first measurement.
struct CloudSlice {
  Scan scan;
  Eigen::Isometry3d T_world_level = Eigen::Isometry3d::Identity();
  bool times_valid = true;          ///< else all measurements were taken for those of one instant (times_of)
  double duration_s = 0.0;          ///< from the first to the last measurement; 0: of one instant
  std::size_t untimed_returns = 0;  ///< left out, since their times are not known where others are
};

/// The horizontal slice of a cloud through its sensor (docs/math/cloud.md).
///
/// Each measurement is taken from where the sensor was at its own time, between `T_world_sensor` (the first) and
/// `T_world_sensor_end` (the last). The scan has the nearest surface between min_height_m and max_height_m in the
/// middle of each bearing. A bearing without one is free if a measurement stayed in the slice as far as max_range_m,
/// and else unknown (kInvalid): the sensor did not look there, or only above and below. Measurements without a return
/// are known of structured clouds alone, whose directions follow from those of the returns in the same row and column.
/// Times that cannot be are taken for one instant. A return whose own time is not known (NaN) is left out; a
/// measurement without one was when the one before it in its row was.
///
/// The beams go all around, in the order of their times where the sensor sweeps around; else counter-clockwise and
/// without times. Throws std::invalid_argument if the cloud has not rows * columns points, or a pose is not finite.
/// `memory`: as for limit_range.
CloudSlice slice_cloud(const Cloud& cloud, const Eigen::Isometry3d& T_world_sensor,
                       const Eigen::Isometry3d& T_world_sensor_end, const CloudSliceParams& params,
                       CloudSlice memory = {});

/// By how much the hits of clouds are off whose points have no times, while the sensor that sweeps around moves.
class UntimedMotion {
 public:
  /// Adds the slice of the sensor's next cloud. True if it is off by more than max_depth_m: a surface seen twice is
  /// two.
  bool add(const CloudSlice& slice, const Eigen::Isometry3d& T_world_sensor, const CloudSliceParams& params);

  std::size_t clouds() const { return clouds_; }
  double most_m() const { return most_m_; }

 private:
  std::optional<std::int64_t> stamp_ns_;
  Eigen::Isometry3d T_world_sensor_ = Eigen::Isometry3d::Identity();  ///< of the cloud before
  std::size_t clouds_ = 0;                                            ///< that are off
  double most_m_ = 0.0;
};

}  // namespace situation_awareness

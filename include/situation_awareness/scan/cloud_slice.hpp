// SPDX-License-Identifier: BSD-3-Clause
#pragma once

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

/// The first and the last of times that are added one by one.
class CloudTimeRange {
 public:
  void add(double time_s);

  /// None if a time was not finite, or more than a second from the stamp. Both 0 if there was none.
  std::optional<CloudTimes> times() const;

 private:
  std::optional<CloudTimes> times_;
  bool valid_ = true;
};

/// As CloudTimeRange has them.
std::optional<CloudTimes> times_of(const Cloud& cloud);

/// A scan in a level frame: origin at the sensor when it took the first measurement, z up, x the sensor's x axis turned
/// into the horizontal plane. The stamp is the time of the first measurement.
struct CloudSlice {
  Scan scan;
  Eigen::Isometry3d T_world_level = Eigen::Isometry3d::Identity();
  bool times_valid = true;  ///< else all measurements were taken for those of one instant (times_of)
};

/// The horizontal slice of a cloud through its sensor (docs/math/cloud.md).
///
/// Each measurement is taken from where the sensor was at its own time, between `T_world_sensor` (the first) and
/// `T_world_sensor_end` (the last). The scan has the nearest surface between min_height_m and max_height_m in the
/// middle of each bearing. A bearing without one is free if a measurement stayed in the slice as far as max_range_m,
/// and else unknown (kInvalid): the sensor did not look there, or only above and below. Measurements without a return
/// are known of structured clouds alone, whose directions follow from those of the returns in the same row and column.
/// Times that cannot be are taken for one instant.
///
/// The beams go all around, in the order of their times where the sensor sweeps around; else counter-clockwise and
/// without times. Throws std::invalid_argument if the cloud has not rows * columns points, or a pose is not finite.
/// `memory`: as for limit_range.
CloudSlice slice_cloud(const Cloud& cloud, const Eigen::Isometry3d& T_world_sensor,
                       const Eigen::Isometry3d& T_world_sensor_end, const CloudSliceParams& params,
                       CloudSlice memory = {});

}  // namespace situation_awareness

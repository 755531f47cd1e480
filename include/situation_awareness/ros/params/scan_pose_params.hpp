// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <Eigen/Core>

#include "situation_awareness/common/params.hpp"

namespace situation_awareness {

/// How well the pose of a scan is known, for nodelets that map segments.
struct ScanPoseParams {
  double pose_sigma_m = 0.02;
  double pose_sigma_rad = 0.01;
  double pose_timeout_s = 0.2;

  template <class Self, class Visit>
  static void fields(Self& self, Visit&& visit) {
    visit("pose_sigma_m", self.pose_sigma_m, Bounds{0.0, 100.0}, "m",
          "standard deviation of x and of y of a scan's pose that comes without a covariance on `pose`");
    visit("pose_sigma_rad", self.pose_sigma_rad, Bounds{0.0, 3.0}, "rad", "the same of its yaw");
    visit("pose_timeout_s", self.pose_timeout_s, Bounds{0.0, 60.0}, "s",
          "maximum time for which segments wait for the covariance of their pose and for the map of objects, in wall "
          "time, where `pose` or `objects` has a publisher");
  }

  /// The covariance of x, y (m) and yaw (rad), which is that of independent errors with these standard deviations.
  Eigen::Matrix3d covariance() const {
    return Eigen::Array3d(pose_sigma_m, pose_sigma_m, pose_sigma_rad).square().matrix().asDiagonal();
  }
};

}  // namespace situation_awareness

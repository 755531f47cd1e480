// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <string>

#include <ros/time.h>
#include <tf2_ros/buffer.h>

#include "situation_awareness/ros/stage_diagnostics.hpp"

namespace situation_awareness {

/// Delays of transforms, for /diagnostics.
class TransformAge {
 public:
  /// `tf` must outlive this.
  TransformAge(const tf2_ros::Buffer& tf, const std::string& world_frame) : tf_(tf), world_frame_(world_frame) {}

  /// On arrival of a scan: records the age, in ROS time, of the newest transform to its frame. Does not throw.
  void scan_arrived(const std::string& frame);

  /// Records how long a scan waited for its transform.
  void scan_waited(double waited_s) { waits_.add(1e3 * waited_s); }

  void report(StageDiagnostics::Status& status);

 private:
  const tf2_ros::Buffer& tf_;
  std::string world_frame_;
  bool static_ = false;  ///< the transform has no time, so no age
  Samples ages_;
  Samples waits_;
};

}  // namespace situation_awareness

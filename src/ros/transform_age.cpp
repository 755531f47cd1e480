// SPDX-License-Identifier: BSD-3-Clause
#include "situation_awareness/ros/transform_age.hpp"

#include <cmath>

#include <tf2/exceptions.h>

#include "situation_awareness/ros/convert/time.hpp"

namespace situation_awareness {

void TransformAge::scan_arrived(const std::string& frame) {
  const ros::Time latest(0);
  if (!tf_.canTransform(world_frame_, frame, latest)) return;
  try {
    const ros::Time stamp = tf_.lookupTransform(world_frame_, frame, latest).header.stamp;
    static_ = stamp.isZero();
    if (static_) return;
    const double age_ms = static_cast<double>(to_nanoseconds(ros::Time::now()) - to_nanoseconds(stamp)) * 1e-6;
    if (std::abs(age_ms) <= Samples::kMost_ms) ages_.add(age_ms);
  } catch (const tf2::TransformException&) {  // removed meanwhile: reported with the scan
  }
}

void TransformAge::report(StageDiagnostics::Status& status) {
  if (static_) {
    status.add("TF age", "none: the transform is static");
  } else if (ages_.empty()) {
    status.add("TF age", "unknown: no scan with a transform of this clock");
  } else {
    ages_.report("TF age", status);
  }
  waits_.report("wait for TF", status);
}

}  // namespace situation_awareness

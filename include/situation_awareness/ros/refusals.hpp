// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstdint>
#include <string>
#include <utility>

#include <diagnostic_msgs/DiagnosticStatus.h>
#include <ros/console.h>
#include <ros/time.h>

#include "situation_awareness/common/counters.hpp"
#include "situation_awareness/ros/stage_diagnostics.hpp"

namespace situation_awareness {

/// What a stage does not use of an input other than that which it processes, such as odometry: counted by reason, in
/// the log at most each 5 s, and on /diagnostics.
class Refusals {
 public:
  /// `stage`: its name in the log.
  explicit Refusals(std::string stage) : stage_(std::move(stage)) { counters_.reset(); }

  /// `detail` is not counted apart.
  void add(const std::string& reason, const std::string& detail = "") {
    ++counters_[reason];
    ++count_;
    latest_ = detail.empty() ? reason : reason + ": " + detail;
    const ros::Time now = ros::Time::now();
    if (!logged_.isZero() && now >= logged_ && now - logged_ < ros::Duration(5.0)) return;
    logged_ = now;
    ROS_WARN_STREAM(stage_ << ": not used, " << latest_);
  }

  /// Empty before the first.
  const std::string& latest() const { return latest_; }

  /// All counts, and a warning if there are new ones since the last report.
  void report(StageDiagnostics::Status& status) {
    if (count_ > reported_) {
      status.mergeSummary(diagnostic_msgs::DiagnosticStatus::WARN, "not used: " + latest_);
    }
    for (const auto& [reason, count] : counters_) status.add("not used: " + reason, count);
    reported_ = count_;
  }

 private:
  std::string stage_;
  Counters counters_;
  std::uint64_t count_ = 0, reported_ = 0;
  std::string latest_;
  ros::Time logged_;  ///< of each stage its own
};

}  // namespace situation_awareness

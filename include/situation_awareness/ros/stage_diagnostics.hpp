// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstdint>
#include <map>
#include <string>
#include <vector>

#include <diagnostic_updater/diagnostic_updater.h>
#include <ros/node_handle.h>
#include <ros/timer.h>

#include "situation_awareness/common/counters.hpp"

namespace situation_awareness {

/// What one nodelet says about itself on /diagnostics, once a second in wall time: what came in, what went out, what
/// was dropped and why, and how long it took. Lives on the callback queue of its node handle, so it needs no lock.
class StageDiagnostics {
 public:
  StageDiagnostics(ros::NodeHandle node, const ros::NodeHandle& private_node, const std::string& name);

  void received() { ++received_; }

  /// Counts, and warns at most every few seconds per reason; `detail` is for the warning alone.
  void dropped(const std::string& reason, const std::string& detail = "");

  /// Adds to what is counted but no fault (why elements were deleted, why segments were no ellipse).
  void counted(const Counters& counters);

  /// What comes is passed over on purpose, from now on or no longer.
  void pause(bool paused) { paused_ = paused; }

  /// Output for the input of `stamp` went out; work on it began at `start`.
  void processed(const ros::Time& stamp, const ros::WallTime& start);

 private:
  void report(diagnostic_updater::DiagnosticStatusWrapper& status);

  std::string name_;
  bool paused_ = false;
  std::uint64_t received_ = 0;
  std::uint64_t processed_ = 0;
  Counters dropped_;
  Counters counted_;
  std::uint64_t reported_received_ = 0;
  std::uint64_t reported_processed_ = 0;
  std::uint64_t reported_dropped_ = 0;
  ros::WallTime reported_at_;
  std::vector<double> latencies_ms_;  ///< since the last report
  std::vector<double> durations_ms_;  ///< since the last report
  std::map<std::string, ros::WallTime> warned_at_;
  diagnostic_updater::Updater updater_;
  ros::WallTimer timer_;
};

}  // namespace situation_awareness

// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstdint>
#include <string>

#include "situation_awareness/ros/gps_ins_input.hpp"
#include "situation_awareness/ros/stage_diagnostics.hpp"

namespace situation_awareness {

/// What the pose by GPS and INS says on /diagnostics and in the log.
class GpsInsReport {
 public:
  /// `name`: of the nodelet; `input` must outlive this.
  GpsInsReport(const std::string& name, GpsInsInput& input) : name_(name), input_(input) {}

  /// After a sample: says in the log when the pose becomes ready, and when it is not any more.
  void add();

  void report(StageDiagnostics::Status& status);

 private:
  void report_filter(GpsIns& filter, StageDiagnostics::Status& status);

  std::string name_;
  GpsInsInput& input_;
  bool is_ready_ = false;
  std::int64_t used_ns_ = StampOrder::kNone;  ///< until when fixes were used
};

}  // namespace situation_awareness

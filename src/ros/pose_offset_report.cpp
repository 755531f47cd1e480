// SPDX-License-Identifier: BSD-3-Clause
#include "situation_awareness/ros/pose_offset_report.hpp"

#include "situation_awareness/common/format.hpp"

namespace situation_awareness {
std::string pose_offset_advice(const PoseOffsetEstimator& estimator) {
  if (!is_out_of_step(estimator.estimate(), estimator.used_offset_s())) return "";
  return formatted("scans and poses are out of step: set scan_pose_offset_s to %.3f, not %.3f",
                   estimator.estimate().offset_s, estimator.used_offset_s());
}

std::string pose_offset_text(const PoseOffset& estimate) {
  if (!estimate.is_known) return "unknown: the motion has not shown it";
  return formatted("%.3f s, sigma %.3f s", estimate.offset_s, estimate.sigma_s);
}

void report_scanner(const ScannerCheck& check, StageDiagnostics::Status& status) {
  status.add("nothing there", check.no_return_text());
  for (const std::string& advice : check.advice()) {
    status.mergeSummary(diagnostic_msgs::DiagnosticStatus::WARN, advice);
  }
}

void report_pose_offset(const ScannerCheck& check, StageDiagnostics::Status& status) {
  const PoseOffsetEstimator& estimator = check.pose_offset();
  status.addf("scan_pose_offset_s", "%.3f", estimator.used_offset_s());
  status.add("scan-pose offset estimate", pose_offset_text(estimator.estimate()));
  if (check.is_out_of_step()) {
    status.mergeSummary(diagnostic_msgs::DiagnosticStatus::WARN, pose_offset_advice(estimator));
  }
}

}  // namespace situation_awareness

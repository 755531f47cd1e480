// SPDX-License-Identifier: BSD-3-Clause
#include "situation_awareness/ros/nis_report.hpp"

namespace situation_awareness {

NisMonitor::Summary report_nis(NisMonitor& nis, StageDiagnostics::Status& status, const std::string& sensor) {
  const NisMonitor::Summary summary = nis.summarise();
  const std::string key = sensor.empty() ? "NIS" : sensor + " NIS";
  status.add(key + " matches", summary.matches);
  if (summary.matches > 0) {
    status.addf(key + " mean", "%.2f", summary.mean);
    status.addf(key + " 95 % bounds", "%.2f to %.2f", summary.low, summary.high);
  }
  if (summary.too_certain) {
    status.mergeSummary(diagnostic_msgs::DiagnosticStatus::WARN,
                        sensor.empty()
                            ? "detections stray by more than the map says: its covariances are too small"
                            : sensor + " measurements stray by more than the filter says: covariances are too small");
  }
  return summary;
}

}  // namespace situation_awareness

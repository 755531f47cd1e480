// SPDX-License-Identifier: BSD-3-Clause
#include "situation_awareness/ros/nis_report.hpp"

namespace situation_awareness {

void report_nis(NisMonitor& nis, StageDiagnostics::Status& status) {
  const NisMonitor::Summary summary = nis.summarise();
  status.add("NIS matches", summary.matches);
  if (summary.matches > 0) {
    status.addf("NIS mean", "%.2f", summary.mean);
    status.addf("NIS 95 % bounds", "%.2f to %.2f", summary.low, summary.high);
  }
  if (summary.too_certain) {
    status.mergeSummary(diagnostic_msgs::DiagnosticStatus::WARN,
                        "detections stray by more than the map says: its covariances are too small");
  }
}

}  // namespace situation_awareness

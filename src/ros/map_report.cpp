// SPDX-License-Identifier: BSD-3-Clause
#include "situation_awareness/ros/map_report.hpp"

#include <algorithm>

namespace situation_awareness {

void report_map(const ObjectMap& map, NisMonitor& nis, StageDiagnostics::Status& status) {
  const Objects shown = map.at(map.stamp_ns());
  const auto moving = std::count_if(shown.objects.begin(), shown.objects.end(),
                                    [](const Object& object) { return object.p_moving > 0.5; });
  status.add("elements", map.size());
  status.add("on the map", shown.objects.size());
  status.add("moving", moving);

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

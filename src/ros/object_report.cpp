// SPDX-License-Identifier: BSD-3-Clause
#include "situation_awareness/ros/object_report.hpp"

#include <algorithm>

namespace situation_awareness {

void report_objects(const ObjectMap& map, StageDiagnostics::Status& status) {
  const Objects shown = map.at(map.stamp_ns());
  const auto moving = std::count_if(shown.objects.begin(), shown.objects.end(),
                                    [](const Object& object) { return object.p_moving > 0.5; });
  status.add("elements", map.size());
  status.add("on the map", shown.objects.size());
  status.add("moving", moving);
}

}  // namespace situation_awareness

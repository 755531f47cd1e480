// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include "situation_awareness/estimation/nis_monitor.hpp"
#include "situation_awareness/map/objects/object_map.hpp"
#include "situation_awareness/ros/stage_diagnostics.hpp"

namespace situation_awareness {

/// What /diagnostics says of the map: how many elements there are, and whether they are as certain as they say. Adds to
/// the summary if they have not been for long.
void report_map(const ObjectMap& map, NisMonitor& nis, StageDiagnostics::Status& status);

}  // namespace situation_awareness

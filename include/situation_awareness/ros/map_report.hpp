// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include "situation_awareness/estimation/nis_monitor.hpp"
#include "situation_awareness/map/objects/object_map.hpp"
#include "situation_awareness/ros/stage_diagnostics.hpp"

namespace situation_awareness {

/// The map's part of /diagnostics: numbers of elements, and the filter's consistency (NIS). Warns in the summary after
/// a longer inconsistency.
void report_map(const ObjectMap& map, NisMonitor& nis, StageDiagnostics::Status& status);

}  // namespace situation_awareness

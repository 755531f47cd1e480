// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <string>

#include "situation_awareness/estimation/nis_monitor.hpp"
#include "situation_awareness/ros/stage_diagnostics.hpp"

namespace situation_awareness {

/// A filter's part of /diagnostics: its consistency (NIS). Warns in the summary after a longer inconsistency. With the
/// name of a sensor, where a filter has several, keys and the warning begin with it.
NisMonitor::Summary report_nis(NisMonitor& nis, StageDiagnostics::Status& status, const std::string& sensor = "");

}  // namespace situation_awareness

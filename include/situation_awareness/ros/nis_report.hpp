// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include "situation_awareness/estimation/nis_monitor.hpp"
#include "situation_awareness/ros/stage_diagnostics.hpp"

namespace situation_awareness {

/// A filter's part of /diagnostics: its consistency (NIS). Warns in the summary after a longer inconsistency.
void report_nis(NisMonitor& nis, StageDiagnostics::Status& status);

}  // namespace situation_awareness

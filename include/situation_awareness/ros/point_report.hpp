// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <string>

#include <diagnostic_msgs/DiagnosticStatus.h>

#include "situation_awareness/points/point_states.hpp"
#include "situation_awareness/ros/stage_diagnostics.hpp"

namespace situation_awareness {

/// Warns while no beam has hit anything of interest.
inline void warn_of_no_hit(const PointStates& states, StageDiagnostics::Status& status) {
  const std::string why = states.why_no_hit();
  if (!why.empty()) status.mergeSummary(diagnostic_msgs::DiagnosticStatus::WARN, why);
}

}  // namespace situation_awareness

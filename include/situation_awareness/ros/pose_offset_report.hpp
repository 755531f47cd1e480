// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <string>

#include "situation_awareness/pipeline/scanner_check.hpp"
#include "situation_awareness/pose/pose_offset.hpp"
#include "situation_awareness/ros/stage_diagnostics.hpp"

namespace situation_awareness {

/// Advice to set scan_pose_offset_s where scans and poses are out of step, else empty.
std::string pose_offset_advice(const PoseOffsetEstimator& estimator);

/// "0.131 s, sigma 0.004 s", or "unknown: the motion has not shown it".
std::string pose_offset_text(const PoseOffset& estimate);

/// Adds what says "nothing there", and as warnings which parameters of the section `scan` are to be set.
void report_scanner(const ScannerCheck& check, StageDiagnostics::Status& status);

/// Adds the offset in use, the estimate, and the advice as a warning.
void report_pose_offset(const ScannerCheck& check, StageDiagnostics::Status& status);

}  // namespace situation_awareness

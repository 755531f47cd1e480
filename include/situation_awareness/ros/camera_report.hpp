// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <diagnostic_updater/diagnostic_updater.h>

#include "situation_awareness/ros/convert/camera.hpp"

namespace situation_awareness {

/// Tells on /diagnostics what the latest image was taken for; a warning where that is not sure.
inline void report(const CameraModel& model, diagnostic_updater::DiagnosticStatusWrapper& status) {
  status.add("images have", model.matrices.empty() ? "no camera yet" : model.matrices + " of camera_info");
  if (!model.assumed.empty()) status.mergeSummary(diagnostic_msgs::DiagnosticStatus::WARN, model.assumed);
}

}  // namespace situation_awareness

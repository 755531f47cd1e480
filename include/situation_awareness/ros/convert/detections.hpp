// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <string>

#include <situation_awareness/DetectionArray.h>

#include "situation_awareness/detections/detections.hpp"

namespace situation_awareness {

DetectionArray detections_to_msg(const Detections& detections, const std::string& world_frame);

/// Throws std::invalid_argument if a detection has a detection_defect, the level frame is not finite, or as
/// free_space_from_msg does.
Detections detections_from_msg(const DetectionArray& msg);

}  // namespace situation_awareness

// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <string>

#include <nav_msgs/Path.h>
#include <situation_awareness/PathError.h>
#include <situation_awareness/SafetyVerdict.h>

#include "situation_awareness/path/path_following.hpp"
#include "situation_awareness/path/safety_areas.hpp"
#include "situation_awareness/path/spline_path.hpp"

namespace situation_awareness {

SafetyVerdict safety_to_msg(const SafetyDecision& decision, double height_world_m, const std::string& world_frame);

/// Throws std::invalid_argument if the verdict is unknown, or the allowed speed is not finite, negative, or, for STOP,
/// not 0.
AllowedMotion allowed_motion_from_msg(const SafetyVerdict& msg);

PathError path_error_to_msg(const PathFollowingResult& result, double allowed_speed_m_s, std::int64_t stamp_ns,
                            const std::string& world_frame);

/// Poses along a path, 5 cm apart, and one at its end.
nav_msgs::Path path_to_msg(const SplinePath& path, std::int64_t stamp_ns, const std::string& world_frame);

}  // namespace situation_awareness

// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <string>

#include "situation_awareness/geometry/pose2.hpp"

namespace situation_awareness {

/// A pose from text, "X,Y,YAW" in m and rad. Throws std::invalid_argument naming `source`.
Pose2 parse_pose2(const std::string& text, const std::string& source);

}  // namespace situation_awareness

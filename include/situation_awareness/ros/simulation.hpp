// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstdint>
#include <string>

#include "situation_awareness/common/time.hpp"

namespace situation_awareness {

/// The simulation's time 0 on the clock of ROS, to which a time of zero means "not started" on /clock and "the latest"
/// in TF.
constexpr std::int64_t kSimulationStart_ns = 1000 * kNanosecondsPerSecond;

/// The file of a world: a path as it is, a name as that of a world of this package.
std::string world_file(const std::string& world);

}  // namespace situation_awareness

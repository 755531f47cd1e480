// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstdint>

#include <ros/time.h>

namespace situation_awareness {

/// When a message is received that is taken now, as StampOrder::judge wants it: ROS time where that is simulated, by
/// which stamps go on however fast it runs, and StampOrder::kNone before it has started; else the steady clock.
std::int64_t receipt_ns();

/// Whether a stamp is ahead of ROS time by more than this; not before that has started.
bool is_ahead_of_clock(const ros::Time& stamp, double most_s);

}  // namespace situation_awareness

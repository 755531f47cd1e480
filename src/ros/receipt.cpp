// SPDX-License-Identifier: BSD-3-Clause
#include "situation_awareness/ros/receipt.hpp"

#include "situation_awareness/common/stamp_order.hpp"
#include "situation_awareness/common/time.hpp"
#include "situation_awareness/ros/convert/time.hpp"

namespace situation_awareness {

std::int64_t receipt_ns() {
  if (!ros::Time::isSimTime()) return steady_now_ns();
  const ros::Time now = ros::Time::now();
  return now.isZero() ? StampOrder::kNone : to_nanoseconds(now);
}

bool is_ahead_of_clock(const ros::Time& stamp, double most_s) {
  const ros::Time now = ros::Time::now();
  return !now.isZero() && seconds_between(to_nanoseconds(now), to_nanoseconds(stamp)) > most_s;
}

}  // namespace situation_awareness

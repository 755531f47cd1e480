// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstdint>
#include <stdexcept>

#include <ros/time.h>

namespace situation_awareness {

inline std::int64_t to_nanoseconds(const ros::Time& time) { return static_cast<std::int64_t>(time.toNSec()); }

/// Of the steady clock, which a change of the wall clock or simulated time does not affect.
inline std::int64_t steady_now_ns() { return static_cast<std::int64_t>(ros::SteadyTime::now().toNSec()); }

/// Throws std::invalid_argument outside the range of ROS times: before 1970 and after 2106.
inline ros::Time to_ros_time(std::int64_t stamp_ns) {
  constexpr std::int64_t kEndOfRosTime_ns = (std::int64_t{1} << 32) * 1'000'000'000;
  if (stamp_ns < 0 || stamp_ns >= kEndOfRosTime_ns) throw std::invalid_argument("stamp is outside the time of ROS");
  ros::Time time;
  time.fromNSec(static_cast<std::uint64_t>(stamp_ns));
  return time;
}

}  // namespace situation_awareness

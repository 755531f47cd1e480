// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <string>

#include <sensor_msgs/LaserScan.h>

namespace situation_awareness {

/// Reason why a scan from a driver or a bag is invalid, regardless of its transform; empty if it is valid. The texts
/// are fixed, for counters.
std::string scan_msg_defect(const sensor_msgs::LaserScan& msg);

namespace drop_reason {
constexpr const char* kStamp = "stamp repeats or goes back";
constexpr const char* kAnotherTime = "stamp of another time than those around it";
constexpr const char* kAheadOfClock = "stamp ahead of the clock";
constexpr const char* kRestart = "stamp started again while it waited";
constexpr const char* kOvertaken = "overtaken";
constexpr const char* kQueueFull = "queue full";
constexpr const char* kNoTransform = "no transform";
constexpr const char* kBadTransform = "bad transform";
constexpr const char* kBadMessage = "bad message";
constexpr const char* kBadMap = "bad map";
constexpr const char* kError = "error";
}  // namespace drop_reason

}  // namespace situation_awareness

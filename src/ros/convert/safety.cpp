// SPDX-License-Identifier: BSD-3-Clause
#include "situation_awareness/ros/convert/safety.hpp"

#include <algorithm>
#include <cmath>
#include <stdexcept>

#include "situation_awareness/ros/convert/time.hpp"

namespace situation_awareness {
namespace {

constexpr double kPathSpacing_m = 0.05;
constexpr double kMostPoses = 20'000;

using Decided = SafetyDecision::Verdict;
using State = PathFollowingResult::State;

static_assert(static_cast<int>(Decided::kFullSpeed) == SafetyVerdict::FULL_SPEED &&
              static_cast<int>(Decided::kSlow) == SafetyVerdict::SLOW &&
              static_cast<int>(Decided::kStop) == SafetyVerdict::STOP);
static_assert(static_cast<int>(SafetyDecision::Kind::kUnknownHit) == SafetyVerdict::UNKNOWN_HIT &&
              static_cast<int>(SafetyDecision::Kind::kChain) == SafetyVerdict::CHAIN &&
              static_cast<int>(SafetyDecision::Kind::kObject) == SafetyVerdict::OBJECT &&
              static_cast<int>(SafetyDecision::Kind::kHidden) == SafetyVerdict::HIDDEN &&
              static_cast<int>(SafetyDecision::Kind::kPose) == SafetyVerdict::POSE &&
              static_cast<int>(SafetyDecision::Kind::kContradiction) == SafetyVerdict::CONTRADICTION &&
              static_cast<int>(SafetyDecision::Kind::kFrozenScan) == SafetyVerdict::FROZEN_SCAN);
static_assert(static_cast<int>(SafetyInput::kMap) == SafetyVerdict::MAP &&
              static_cast<int>(SafetyInput::kCovariance) == SafetyVerdict::COVARIANCE &&
              static_cast<int>(SafetyInput::kSpeed) == SafetyVerdict::SPEED);
static_assert(static_cast<int>(SafetyPolicy::kConservative) == SafetyVerdict::CONSERVATIVE &&
              static_cast<int>(SafetyPolicy::kUpdated) == SafetyVerdict::UPDATED &&
              static_cast<int>(SafetyPolicy::kIgnoreKnown) == SafetyVerdict::IGNORE_KNOWN);
static_assert(static_cast<int>(State::kStopped) == PathError::STOPPED &&
              static_cast<int>(State::kTurning) == PathError::TURNING &&
              static_cast<int>(State::kDriving) == PathError::DRIVING &&
              static_cast<int>(State::kWaiting) == PathError::WAITING &&
              static_cast<int>(State::kArrived) == PathError::ARRIVED &&
              static_cast<int>(State::kOffPath) == PathError::OFF_PATH);

}  // namespace

SafetyVerdict safety_to_msg(const SafetyDecision& decision, double height_world_m, const std::string& world_frame) {
  SafetyVerdict msg;
  msg.header.stamp = to_ros_time(decision.stamp_ns);
  msg.header.frame_id = world_frame;
  msg.verdict = static_cast<std::uint8_t>(decision.verdict);
  msg.distance_m = decision.distance_m;
  msg.kind = static_cast<std::uint8_t>(decision.kind);
  msg.id = decision.id;
  if (has_place(decision.kind)) {
    msg.place.x = decision.place_world_m.x();
    msg.place.y = decision.place_world_m.y();
    msg.place.z = height_world_m;
  }
  msg.allowed_speed_m_s = decision.allowed_speed_m_s;
  msg.may_turn = static_cast<std::uint8_t>(decision.may_turn);
  msg.policy = static_cast<std::uint8_t>(decision.policy);
  for (const SafetyInput input : decision.missing) msg.missing.push_back(static_cast<std::uint8_t>(input));
  msg.segment = static_cast<std::uint32_t>(decision.segment);
  return msg;
}

AllowedMotion allowed_motion_from_msg(const SafetyVerdict& msg) {
  if (msg.verdict > SafetyVerdict::STOP) throw std::invalid_argument("verdict is unknown");
  if (!(std::isfinite(msg.allowed_speed_m_s) && msg.allowed_speed_m_s >= 0.0)) {
    throw std::invalid_argument("allowed_speed_m_s is not a number >= 0");
  }
  if (msg.verdict == SafetyVerdict::STOP && msg.allowed_speed_m_s > 0.0) {
    throw std::invalid_argument("allowed_speed_m_s is not 0 for STOP");
  }
  return {msg.allowed_speed_m_s, msg.may_turn != 0};
}

PathError path_error_to_msg(const PathFollowingResult& result, double allowed_speed_m_s, std::int64_t stamp_ns,
                            const std::string& world_frame) {
  PathError msg;
  msg.header.stamp = to_ros_time(stamp_ns);
  msg.header.frame_id = world_frame;
  msg.along_m = result.error.along_m;
  msg.across_m = result.error.across_m;
  msg.heading_rad = result.error.heading_rad;
  msg.way_m = result.way_m;
  msg.speed_m_s = result.command.speed_m_s;
  msg.turn_rate_rad_s = result.command.turn_rate_rad_s;
  msg.allowed_speed_m_s = allowed_speed_m_s;
  msg.state = static_cast<std::uint8_t>(result.state);
  msg.transit = static_cast<std::uint32_t>(result.transit);
  msg.there = static_cast<std::uint8_t>(result.there);
  return msg;
}

nav_msgs::Path path_to_msg(const SplinePath& path, std::int64_t stamp_ns, const std::string& world_frame) {
  nav_msgs::Path msg;
  msg.header.stamp = to_ros_time(stamp_ns);
  msg.header.frame_id = world_frame;
  const double step_m = std::max(kPathSpacing_m, path.length_m() / kMostPoses);
  for (double way_m = 0.0;; way_m += step_m) {
    const PathPoint point = path.at(std::min(way_m, path.length_m() * (1.0 - 1e-12)));
    geometry_msgs::PoseStamped pose;
    pose.header = msg.header;
    pose.pose.position.x = point.p_world_m.x();
    pose.pose.position.y = point.p_world_m.y();
    pose.pose.orientation.z = std::sin(0.5 * point.yaw_rad);
    pose.pose.orientation.w = std::cos(0.5 * point.yaw_rad);
    msg.poses.push_back(pose);
    if (way_m >= path.length_m()) return msg;
  }
}

}  // namespace situation_awareness

// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstdint>
#include <functional>
#include <string>

#include "situation_awareness/common/counters.hpp"
#include "situation_awareness/geometry/pose2.hpp"
#include "situation_awareness/pipeline/polygon_pipeline.hpp"
#include "situation_awareness/ros/bag/bag_options.hpp"
#include "situation_awareness/ros/bag/bag_player.hpp"
#include "situation_awareness/ros/convert/odometry.hpp"
#include "situation_awareness/scan/range_limiter.hpp"
#include "situation_awareness/scan/scan.hpp"

namespace situation_awareness {

/// Where odometry is, and the names of its frames where the messages have none or others.
struct OdometryOptions {
  std::string topic = "/odom";
  OdometryFrames frames;
};

void add_odometry_options(CommandLine& app, OdometryOptions& options);

/// The frames of odometry: those of the options, or else those of the first message that names them; empty where there
/// is no odometry. Throws std::runtime_error naming topic and field where the messages do not name one.
OdometryFrames odometry_frames(const BagOptions& bag, const OdometryOptions& options);

/// The base of a map by TF: that of the options, or else the child frame of odometry, where the transforms of the
/// recording have it; else empty. Odometry that names another frame, or none, is not needed there.
std::string base_frame_by_tf(const BagOptions& bag, const OdometryOptions& options);

/// What to do with odometry and the scans that it places.
struct UseOdometry {
  /// What it refuses is not used.
  std::function<OdometryTrack::Verdict(std::int64_t stamp_ns, const Pose2& T_odom_base, std::int64_t received_ns)> add;
  std::function<void(const Scan& scan, const OdometryScan& placed)> use;
};

/// Subscribes to odometry and scans (bag/scans.hpp) of a player to which the poses are given: scans wait for the
/// odometry of their first and last beams. Messages that cannot be used are counted in `refused`, which must outlive
/// the player. Throws as BagPlayer::subscribe does, and std::runtime_error where there is no message of odometry.
void subscribe_odometry_scans(BagPlayer& player, const std::string& odom_topic, const std::string& scan_topic,
                              const RangeLimiterParams& scan_params, const OdometryFrames& frames, Counters& refused,
                              UseOdometry use);

}  // namespace situation_awareness

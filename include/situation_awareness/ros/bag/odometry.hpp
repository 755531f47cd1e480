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
#include "situation_awareness/scan/scan.hpp"

namespace situation_awareness {

/// Frames of the first message of a topic in the bag; empty where there is none.
OdometryFrames odometry_frames(const BagOptions& options, const std::string& topic);

/// What to do with odometry and the scans that it places.
struct UseOdometry {
  /// What it refuses is not used.
  std::function<OdometryTrack::Verdict(std::int64_t stamp_ns, const Pose2& T_odom_base, std::int64_t received_ns)> add;
  std::function<void(const Scan& scan, const OdometryScan& placed)> use;
};

/// Subscribes to odometry and scans of a player whose world frame is that of the odometry: scans wait for the odometry
/// of their first and last beams. Messages that cannot be used are counted in `refused`, which must outlive the player.
/// Throws as BagPlayer::subscribe does.
void subscribe_odometry_scans(BagPlayer& player, const std::string& odom_topic, const std::string& scan_topic,
                              const OdometryFrames& frames, Counters& refused, UseOdometry use);

}  // namespace situation_awareness

// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <functional>
#include <string>

#include <Eigen/Geometry>

#include "situation_awareness/ros/bag/bag_player.hpp"
#include "situation_awareness/scan/scan.hpp"

namespace situation_awareness {

/// Handles a valid scan with the poses of the lidar at its first and last beam.
using UseScan = std::function<void(const Scan& scan, const Eigen::Isometry3d& T_world_lidar,
                                   const Eigen::Isometry3d& T_world_lidar_end)>;

/// Subscribes to the scans of a topic; invalid ones are counted, as in segmentation. They are of the frame
/// `lidar_frame`, or of that of their messages if it is empty. Throws as BagPlayer::subscribe does.
void subscribe_scans(BagPlayer& player, const std::string& topic, UseScan use, const std::string& lidar_frame = {});

}  // namespace situation_awareness

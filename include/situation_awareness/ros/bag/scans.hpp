// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <functional>
#include <string>

#include <Eigen/Geometry>

#include "situation_awareness/ros/bag/bag_player.hpp"
#include "situation_awareness/scan/scan.hpp"

namespace situation_awareness {

/// Handles a scan that can be projected, with the poses of the lidar at its first beam and at its last.
using UseScan = std::function<void(const Scan& scan, const Eigen::Isometry3d& T_world_lidar,
                                   const Eigen::Isometry3d& T_world_lidar_end)>;

/// The scans of a topic are what the program is about; those that cannot be used are counted, as segmentation does.
/// Throws as BagPlayer::subscribe does.
void subscribe_scans(BagPlayer& player, const std::string& topic, UseScan use);

}  // namespace situation_awareness

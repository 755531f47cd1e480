// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstddef>
#include <functional>
#include <memory>
#include <string>

#include <Eigen/Geometry>

#include "situation_awareness/pipeline/scanner_check.hpp"
#include "situation_awareness/ros/bag/bag_player.hpp"
#include "situation_awareness/scan/cloud_slice.hpp"
#include "situation_awareness/scan/range_limiter.hpp"
#include "situation_awareness/scan/scan.hpp"

namespace situation_awareness {

/// Handles a valid scan with the poses of the lidar at its first and last beam.
using UseScan = std::function<void(const Scan& scan, const Eigen::Isometry3d& T_world_lidar,
                                   const Eigen::Isometry3d& T_world_lidar_end)>;

/// Subscribes to the scans of a topic; invalid ones are counted, as in segmentation. They are of the frame
/// `lidar_frame`, or of that of their messages if it is empty. The summary warns where the driver's messages are not as
/// `params` say. Throws as BagPlayer::subscribe does.
std::shared_ptr<const ScannerCheck> subscribe_scans(BagPlayer& player, const std::string& topic,
                                                    const RangeLimiterParams& params, UseScan use,
                                                    const std::string& lidar_frame = {});

/// Subscribes to the clouds of a topic, of which scans are made as the nodelet slicing does: they are as of a scanner
/// that stands still in its level frame. The summary warns as with subscribe_scans, and of what the times of points
/// lack. Throws as BagPlayer::subscribe does.
std::shared_ptr<const ScannerCheck> subscribe_clouds(BagPlayer& player, const std::string& topic,
                                                     const RangeLimiterParams& params,
                                                     const CloudSliceParams& cloud_params, UseScan use,
                                                     const std::string& lidar_frame = {});

/// Where scans are, or clouds in place of them.
struct ScanTopics {
  std::string scans = "/scan", clouds;
};

/// --scan-topic and --cloud-topic.
void add_scan_options(CommandLine& app, ScanTopics& topics);

/// Subscribes to the clouds, or to the scans where there is no topic of clouds.
std::shared_ptr<const ScannerCheck> subscribe_scans_or_clouds(BagPlayer& player, const ScanTopics& topics,
                                                              const RangeLimiterParams& params,
                                                              const CloudSliceParams& cloud_params, UseScan use,
                                                              const std::string& lidar_frame = {});

}  // namespace situation_awareness

// SPDX-License-Identifier: BSD-3-Clause
#include "situation_awareness/ros/bag/scans.hpp"

#include <utility>

#include <sensor_msgs/LaserScan.h>

#include "situation_awareness/points/horizontal_projection.hpp"
#include "situation_awareness/ros/convert/poses.hpp"
#include "situation_awareness/ros/convert/scan.hpp"
#include "situation_awareness/ros/scan_check.hpp"
#include "situation_awareness/ros/transform_queue.hpp"

namespace situation_awareness {

void subscribe_scans(BagPlayer& player, const std::string& topic, UseScan use, const std::string& lidar_frame) {
  player.subscribe_measurements<sensor_msgs::LaserScan>(
      topic, "scans",
      [&player, use = std::move(use), frame = tf2_frame(lidar_frame)](const sensor_msgs::LaserScanConstPtr& msg,
                                                                      const ros::Time& recorded) {
        const std::string defect = scan_msg_defect(*msg);
        if (!defect.empty()) return player.drop(defect);
        Taken scan_taken = taken(*msg);
        if (!frame.empty()) scan_taken.frame = frame;
        player.use_when_posed(scan_taken, recorded,
                              [msg, &use](const Eigen::Isometry3d& T_world_lidar,
                                          const Eigen::Isometry3d& T_world_lidar_end) -> std::string {
                                const Scan scan = scan_from_msg(*msg);
                                const char* const reason = projection_defect(scan, T_world_lidar, T_world_lidar_end);
                                if (*reason == '\0') use(scan, T_world_lidar, T_world_lidar_end);
                                return reason;
                              });
      });
}

}  // namespace situation_awareness

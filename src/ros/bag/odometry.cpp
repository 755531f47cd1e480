// SPDX-License-Identifier: BSD-3-Clause
#include "situation_awareness/ros/bag/odometry.hpp"

#include <utility>

#include <nav_msgs/Odometry.h>

#include "situation_awareness/ros/bag/first_message.hpp"
#include "situation_awareness/ros/bag/scans.hpp"
#include "situation_awareness/ros/convert/poses.hpp"
#include "situation_awareness/ros/convert/time.hpp"
#include "situation_awareness/ros/transform_queue.hpp"

namespace situation_awareness {

OdometryFrames odometry_frames(const BagOptions& options, const std::string& topic) {
  const auto msg = first_message<nav_msgs::Odometry>(options.bag, topic);
  if (!msg) return {};
  return {tf2_frame(msg->header.frame_id), tf2_frame(msg->child_frame_id)};
}

void subscribe_odometry_scans(BagPlayer& player, const std::string& odom_topic, const std::string& scan_topic,
                              const OdometryFrames& frames, Counters& refused, UseOdometry use) {
  player.subscribe<nav_msgs::Odometry>(
      odom_topic, [&player, &refused, add = std::move(use.add)](const auto& msg, const ros::Time& recorded) {
        const std::string defect = odometry_msg_defect(*msg);
        if (!defect.empty()) {
          ++refused[defect];
          return;
        }
        const geometry_msgs::TransformStamped transform = transform_from_odometry(*msg);
        const auto verdict = add(to_nanoseconds(msg->header.stamp), pose2_of(isometry_from_msg(transform.transform)),
                                 to_nanoseconds(recorded));
        if (verdict == OdometryTrack::Verdict::kRefused) return;
        if (verdict == OdometryTrack::Verdict::kRestarted) player.forget_transforms();
        player.add_transform(transform);
      });
  subscribe_scans(player, scan_topic,
                  [&player, frames, use_scan = std::move(use.use)](const Scan& scan, const auto& T_odom_lidar,
                                                                   const auto& T_odom_lidar_end) {
                    const Eigen::Isometry3d T_odom_base =
                        transform_at(player.transforms(), frames.odom, frames.base, to_ros_time(scan.stamp_ns));
                    OdometryScan placed;
                    placed.T_odom_base = pose2_of(T_odom_base);
                    placed.T_base_lidar = T_odom_base.inverse() * T_odom_lidar;
                    placed.T_odom_base_end = pose2_of(T_odom_lidar_end * placed.T_base_lidar.inverse());
                    use_scan(scan, placed);
                  });
}

}  // namespace situation_awareness

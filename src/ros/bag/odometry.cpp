// SPDX-License-Identifier: BSD-3-Clause
#include "situation_awareness/ros/bag/odometry.hpp"

#include <algorithm>
#include <stdexcept>
#include <utility>

#include <nav_msgs/Odometry.h>
#include <tf2_msgs/TFMessage.h>

#include "command_line.hpp"
#include "situation_awareness/ros/bag/messages.hpp"
#include "situation_awareness/ros/bag/scans.hpp"
#include "situation_awareness/ros/convert/poses.hpp"
#include "situation_awareness/ros/convert/time.hpp"

namespace situation_awareness {

void add_odometry_options(CommandLine& app, OdometryOptions& options) {
  const auto text = [&app](const char* name, std::string& value, const char* type, const char* what) {
    app.add_option(name, value, what).type_name(type);
  };
  text("--odom-topic", options.topic, "TOPIC", "nav_msgs/Odometry");
  text("--odom-frame", options.frames.odom, "FRAME", "of odometry (default: the frame_id of its messages)");
  text("--base-frame", options.frames.base, "FRAME", "of the base (default: their child_frame_id)");
}

OdometryFrames odometry_frames(const BagOptions& bag, const OdometryOptions& options) {
  OdometryFrames frames{tf2_frame(options.frames.odom), tf2_frame(options.frames.base)};
  std::string defect;
  for_each_message<nav_msgs::Odometry>(bag, options.topic, [&](const auto& msg) {
    defect = odometry_frame_defect(*msg, frames, options.topic);
    if (!defect.empty()) return true;
    if (frames.odom.empty()) frames.odom = tf2_frame(msg->header.frame_id);
    if (frames.base.empty()) frames.base = tf2_frame(msg->child_frame_id);
    return false;
  });
  if (!defect.empty()) {
    throw std::runtime_error(recording_name(bag.bags) + ": " + defect +
                             ": --odom-frame and --base-frame name the frames of odometry");
  }
  return frames;
}

std::string base_frame_by_tf(const BagOptions& bag, const OdometryOptions& options) {
  if (!options.frames.base.empty()) return tf2_frame(options.frames.base);
  if (bag.static_sensor) return "";
  std::string base;
  for_each_message<nav_msgs::Odometry>(bag, options.topic, [&base](const auto& msg) {
    base = tf2_frame(msg->child_frame_id);
    return false;
  });
  if (base.empty()) return base;
  bool is_known = false;
  const auto look = [&](const tf2_msgs::TFMessageConstPtr& msg) {
    is_known = std::any_of(msg->transforms.begin(), msg->transforms.end(), [&base](const auto& transform) {
      return tf2_frame(transform.child_frame_id) == base || tf2_frame(transform.header.frame_id) == base;
    });
    return !is_known;
  };
  for (const std::string& topic : {bag.tf_topic, static_topic_of(bag.tf_topic)}) {
    if (!is_known) for_each_message<tf2_msgs::TFMessage>(bag, topic, look);
  }
  return is_known ? base : "";
}

void subscribe_odometry_scans(BagPlayer& player, const std::string& odom_topic, const std::string& scan_topic,
                              const RangeLimiterParams& scan_params, const OdometryFrames& frames, Counters& refused,
                              UseOdometry use) {
  player.subscribe<nav_msgs::Odometry>(odom_topic, [&player, &refused, odom_topic, frames, add = std::move(use.add)](
                                                       const auto& msg, const ros::Time& recorded) {
    std::string defect = odometry_msg_defect(*msg);
    if (defect.empty()) defect = odometry_frame_defect(*msg, frames, odom_topic);
    if (!defect.empty()) {
      ++refused[defect];
      return;
    }
    const geometry_msgs::TransformStamped transform = transform_from_odometry(*msg);
    const auto verdict = add(to_nanoseconds(msg->header.stamp), pose2_of(isometry_from_msg(transform.transform)),
                             to_nanoseconds(recorded));
    if (verdict == OdometryTrack::Verdict::kRefused) return;
    if (verdict == OdometryTrack::Verdict::kRestarted) player.forget_poses();
    player.add_pose(transform);
  });
  if (frames.odom.empty()) throw std::runtime_error("there is no message on " + odom_topic);
  subscribe_scans(player, scan_topic, scan_params,
                  [&player, use_scan = std::move(use.use)](const Scan& scan, const auto& T_odom_lidar,
                                                           const auto& T_odom_lidar_end) {
                    const Eigen::Isometry3d T_odom_base = player.T_world_base_at(scan.stamp_ns);
                    OdometryScan placed;
                    placed.T_odom_base = pose2_of(T_odom_base);
                    placed.T_base_lidar = T_odom_base.inverse() * T_odom_lidar;
                    placed.T_odom_base_end = pose2_of(T_odom_lidar_end * placed.T_base_lidar.inverse());
                    use_scan(scan, placed);
                  });
}

}  // namespace situation_awareness

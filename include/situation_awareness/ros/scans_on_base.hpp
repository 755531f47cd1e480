// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstddef>
#include <functional>
#include <optional>
#include <string>
#include <utility>

#include <geometry_msgs/TransformStamped.h>
#include <ros/node_handle.h>
#include <ros/time.h>
#include <sensor_msgs/LaserScan.h>
#include <tf2/buffer_core.h>
#include <tf2_ros/buffer.h>
#include <Eigen/Geometry>

#include "situation_awareness/ros/transform_input.hpp"
#include "situation_awareness/ros/transform_queue.hpp"
#include "situation_awareness/scan/scanner_params.hpp"

namespace situation_awareness {

/// A scan as it arrived.
struct ArrivedScan {
  sensor_msgs::LaserScanConstPtr msg;
  ros::SteadyTime at;
};

/// The same with the poses of the scanner at its first and last beam, and of the base at the first.
struct ScanOnBase {
  ArrivedScan arrived;
  Eigen::Isometry3d T_odom_lidar, T_odom_lidar_end, T_odom_base;
};

/// Scans that wait for poses of their base in a frame `odom`, which are given here and not by TF: there they may be
/// another source's, or none. TF says only where the scanner is on the base. Poses between two are those of tf2, so
/// that live and offline agree. All calls are on one callback queue, without a lock.
class ScansOnBase {
 public:
  struct Params {
    bool deskew = true;
    double timeout_s = 0.5;            ///< how long a scan waits for its poses
    std::size_t max_waiting = 20;      ///< scans
    double max_stamp_ahead_s = 600.0;  ///< of ROS time
    ScannerParams scanner = {};
  };
  struct Use {
    std::function<void(const std::string& reason, const std::string& detail)> drop;
    /// Reason and detail, where there was no pose of the base.
    std::function<std::pair<std::string, std::string>()> no_pose;
  };

  ScansOnBase(ros::NodeHandle& node, const Params& params, Use use);
  ScansOnBase(const ScansOnBase&) = delete;
  ScansOnBase& operator=(const ScansOnBase&) = delete;

  /// As tf2 names it.
  void set_base_frame(const std::string& frame) { base_frame_ = frame; }

  /// kRestart: all that waited were dropped, and the poses were forgotten.
  StampOrder::Verdict add(const ArrivedScan& arrived);

  /// From odom to base at its stamp; its names of frames do not matter. Throws as tf2.
  void add_pose(geometry_msgs::TransformStamped T_odom_base);

  /// Forgets the poses: those that come next may be of earlier stamps, or of another `odom`.
  void forget_poses();

  /// The next scan that has its poses, in order. Throws as tf2.
  std::optional<ScanOnBase> next();

  std::size_t waiting() const { return queue_.waiting(); }
  /// Whether no scan waits for its poses or is held.
  bool is_empty() const { return queue_.is_empty(); }

  /// For places of other sensors on the base.
  const tf2::BufferCore& tf() const { return tf_; }

 private:
  void mount();
  void dropped(const std::string& reason, const std::string& detail);

  Params params_;
  Use use_;
  tf2_ros::Buffer tf_;           ///< for the place of the scanner on the base
  tf2::BufferCore poses_;        ///< odom -> base -> lidar, by names of its own
  std::string base_frame_;       ///< empty: not known yet
  std::string lidar_frame_;      ///< of the latest scan
  std::string mounted_;          ///< the frame whose place on the base is known; empty: none is
  std::string why_not_mounted_;  ///< tf2's reason
  TransformQueue<ArrivedScan> queue_;
  TransformInput transform_input_;
};

}  // namespace situation_awareness

// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstdint>
#include <functional>
#include <optional>
#include <string>

#include <nav_msgs/Odometry.h>
#include <ros/time.h>
#include <sensor_msgs/LaserScan.h>
#include <std_msgs/Header.h>
#include <Eigen/Geometry>

#include "situation_awareness/geometry/pose2.hpp"
#include "situation_awareness/pose/odometry_track.hpp"
#include "situation_awareness/ros/convert/odometry.hpp"
#include "situation_awareness/ros/params/nodelet_params.hpp"
#include "situation_awareness/ros/refusals.hpp"
#include "situation_awareness/ros/scans_on_base.hpp"
#include "situation_awareness/ros/stage_context.hpp"
#include "situation_awareness/ros/timed_subscriber.hpp"

namespace situation_awareness {

/// A scan with the poses by odometry at its first and last beam.
struct OdometryPosedScan {
  std_msgs::Header header;
  sensor_msgs::LaserScanConstPtr msg;
  Eigen::Isometry3d T_odom_lidar, T_odom_lidar_end;
  Eigen::Isometry3d T_odom_base;  ///< at the first beam
};

/// The input of a stage that places scans by the messages of odometry, and by TF only the scanner on the base: a scan
/// waits until odometry reaches its last beam. Messages are exact where TF may be another filter's, and in a bag, too,
/// so that live and offline agree. Poses between two messages are those of tf2. Drops are counted by reason. All calls
/// are on the callback queue of its stage, without a lock; `context` must outlive it.
class OdometryInput {
 public:
  using Context = StageContext<sensor_msgs::LaserScan, OdometryPosedScan>;

  struct Use {
    /// Takes a pose by odometry; what it refuses is not used.
    std::function<OdometryTrack::Verdict(std::int64_t stamp_ns, const Pose2& T_odom_base, std::int64_t received_ns)>
        add;
  };

  /// `frames`: those of the messages if empty. A stamp of a scan that goes back by more than
  /// StampOrder::kResetTimeJump_s is a restart.
  OdometryInput(Context& context, const NodeletParams& params, const ScannerParams& scanner,
                const OdometryFrames& frames, Use use);
  OdometryInput(const OdometryInput&) = delete;
  OdometryInput& operator=(const OdometryInput&) = delete;

  const OdometryFrames& frames() const { return frames_; }

 private:
  void take(const sensor_msgs::LaserScanConstPtr& msg, const ros::SteadyTime& arrival);
  void add(const nav_msgs::Odometry& msg);
  std::string defect_of(const nav_msgs::Odometry& msg) const;
  void release();
  std::string why_unplaced() const;
  void report(StageDiagnostics::Status& status);

  Context& context_;
  OdometryFrames frames_;
  std::string world_frame_;
  double max_stamp_ahead_s_;
  Use use_;
  ScansOnBase scans_;
  std::function<void()> release_waiting_;
  std::int64_t latest_ns_ = 0;  ///< odometry
  Refusals refusals_;
  std::uint64_t received_ = 0, reported_received_ = 0;
  std::optional<TimedSubscriber<nav_msgs::Odometry>> subscriber_;
};

}  // namespace situation_awareness

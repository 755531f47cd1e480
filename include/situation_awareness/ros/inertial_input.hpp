// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstdint>
#include <functional>
#include <optional>
#include <string>
#include <utility>

#include <ros/time.h>
#include <sensor_msgs/Imu.h>
#include <sensor_msgs/LaserScan.h>
#include <sensor_msgs/NavSatFix.h>
#include <std_msgs/Header.h>
#include <Eigen/Geometry>

#include "situation_awareness/registration/map_alignment.hpp"
#include "situation_awareness/ros/gps_ins_report.hpp"
#include "situation_awareness/ros/inertial_navigation.hpp"
#include "situation_awareness/ros/params/gps_ins_nodelet_params.hpp"
#include "situation_awareness/ros/posed_input.hpp"
#include "situation_awareness/ros/refusals.hpp"
#include "situation_awareness/ros/scans_on_base.hpp"
#include "situation_awareness/ros/stage_context.hpp"
#include "situation_awareness/ros/timed_subscriber.hpp"

namespace situation_awareness {

/// A scan with the poses of the scanner at its first and last beam in the `odom` of InertialNavigation, and what that
/// says of the world.
struct InertialScan {
  std_msgs::Header header;
  sensor_msgs::LaserScanConstPtr msg;
  Eigen::Isometry3d T_odom_lidar, T_odom_lidar_end;
  InertialPlacement placement;

  InertialScan() = default;
  /// By TF: its world is `odom`.
  explicit InertialScan(const PosedMessage<sensor_msgs::LaserScan>& posed)
      : header(posed.header),
        msg(posed.msg),
        T_odom_lidar(posed.T_world_sensor),
        T_odom_lidar_end(posed.T_world_sensor_end) {}
};

/// The input of a stage that places scans by GPS and INS, of the topics `imu` and `fix`: a scan waits until inertial
/// navigation reaches its last beam, one from before the pose was ready for InertialNavigation::kBacklog_s at most.
/// Those are processed at once when it is, and none of them is passed over. What is not used is counted by reason. All
/// calls are on the callback queue of its stage, without a lock; `context` must outlive it.
class InertialInput {
 public:
  using Context = StageContext<sensor_msgs::LaserScan, InertialScan>;

  /// A stamp of a scan that goes back by more than StampOrder::kResetTimeJump_s is a restart. Throws
  /// std::invalid_argument as the parameters' check.
  InertialInput(Context& context, const GpsInsNodeletParams& params, const ScannerParams& scanner);
  InertialInput(const InertialInput&) = delete;
  InertialInput& operator=(const InertialInput&) = delete;

 private:
  void take(const sensor_msgs::LaserScanConstPtr& msg, const ros::SteadyTime& arrival);
  void add(const sensor_msgs::Imu& msg);
  void add(const sensor_msgs::NavSatFix& msg);
  void release();
  std::pair<std::string, std::string> why_no_pose() const;
  void report(StageDiagnostics::Status& status);

  Context& context_;
  double max_stamp_ahead_s_;
  ScansOnBase scans_;
  std::function<void()> release_waiting_;
  InertialNavigation navigation_;
  GpsInsReport report_;
  Refusals refusals_;
  std::uint64_t received_ = 0, reported_received_ = 0, fixes_received_ = 0;
  std::optional<TimedSubscriber<sensor_msgs::Imu>> imu_;
  std::optional<TimedSubscriber<sensor_msgs::NavSatFix>> fix_;
};

}  // namespace situation_awareness

// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstdint>
#include <deque>
#include <functional>
#include <string>
#include <vector>

#include <geometry_msgs/TransformStamped.h>
#include <sensor_msgs/Imu.h>
#include <sensor_msgs/NavSatFix.h>
#include <tf2/buffer_core.h>
#include <Eigen/Core>
#include <Eigen/Geometry>

#include "situation_awareness/common/stamp_order.hpp"
#include "situation_awareness/pose/gps_ins.hpp"
#include "situation_awareness/registration/inertial_odometry.hpp"
#include "situation_awareness/ros/gps_ins_input.hpp"
#include "situation_awareness/ros/params/gps_ins_nodelet_params.hpp"

namespace situation_awareness {

/// What messages of IMU and fixes say of the motion: InertialOdometry by them. Once the pose is ready it is followed
/// back (GpsInsBacklog), for what waited meanwhile. After a gap of the IMU all that begins anew, where the pose after
/// the gap is in the `odom` before it; after a jump of its stamps back, with another `odom`. Memory is bounded by
/// kBacklog_s.
///
/// What is made of the messages does not depend on when fixes arrive among the samples, if it is within kPatience_s of
/// their stamps: samples are used at once, and each fix when the samples are so far after it. Samples that come before
/// it is known where the sensors are wait for that.
class InertialNavigation {
 public:
  /// The time before the pose was ready of which there are poses.
  static constexpr double kBacklog_s = 30.0;
  /// From the stamp of a fix, by those of the samples, to its use: receivers of GPS need up to so long for it. A fix
  /// that comes later is used when it comes, and counted. The pose knows of a fix so much later, which is less than
  /// most fixes are apart.
  static constexpr double kPatience_s = 0.2;

  struct Use {
    /// Takes the poses of the base, by ascending stamps. The names of the frames are empty.
    std::function<void(const geometry_msgs::TransformStamped& T_odom_base)> add;
    /// Called before it begins anew: what poses there were is known for the last time.
    std::function<void()> restart;
  };

  /// `tf`: for the places of the sensors on the base; must outlive this. Throws std::invalid_argument as the
  /// parameters' check.
  InertialNavigation(const GpsInsNodeletParams& params, const tf2::BufferCore& tf, Use use);

  /// As GpsInsInput::add_imu. Throws as Use::add.
  std::string add_imu(const sensor_msgs::Imu& msg, std::int64_t received_ns = StampOrder::kNone);
  void add_fix(const sensor_msgs::NavSatFix& msg, std::int64_t received_ns = StampOrder::kNone);

  bool is_ready() const { return odometry_.has_begun(); }
  /// Whether the pose was ready at the stamp; poses of stamps before that are made of what came later, for which what
  /// was measured then waited.
  bool was_ready_at(std::int64_t stamp_ns) const { return odometry_.was_ready_at(stamp_ns); }
  /// The stamp of the latest pose; StampOrder::kNone without one.
  std::int64_t stamp_ns() const { return odometry_.stamp_ns(); }

  /// These two are InertialOdometry::placement_at and pose_at.
  InertialPlacement placement_at(std::int64_t stamp_ns, const Eigen::Isometry3d& T_odom_base,
                                 const Eigen::Isometry3d& T_odom_lidar) {
    return odometry_.placement_at(stamp_ns, T_odom_base, T_odom_lidar);
  }
  WorldPose pose_at(std::int64_t stamp_ns, const Eigen::Isometry3d& T_odom_base, const MapAlignment& alignment) {
    return odometry_.pose_at(stamp_ns, T_odom_base, alignment);
  }

  /// Fixes that came after their patience was over.
  std::uint64_t late_fixes() const { return late_fixes_; }

  GpsInsInput& input() { return input_; }
  const GpsInsInput& input() const { return input_; }

 private:
  template <class Message>
  struct Waiting {
    Message msg;
    std::int64_t received_ns;
  };

  void follow();
  void use_fixes();
  void use_fix(const Waiting<sensor_msgs::NavSatFix>& fix);
  void place_fixes();
  void go_on(const GpsInsPose& pose);
  void restart(std::int64_t stamp_ns);

  GpsInsInput input_;
  Use use_;
  std::deque<Waiting<sensor_msgs::Imu>> samples_;              ///< until there is a filter
  std::deque<Waiting<sensor_msgs::NavSatFix>> waiting_fixes_;  ///< by stamp
  std::uint64_t late_fixes_ = 0;
  InertialOdometry odometry_;
};

}  // namespace situation_awareness

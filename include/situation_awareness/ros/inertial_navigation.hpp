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
#include "situation_awareness/geometry/pose2.hpp"
#include "situation_awareness/pipeline/map_alignment.hpp"
#include "situation_awareness/pose/gps_ins.hpp"
#include "situation_awareness/ros/gps_ins_input.hpp"
#include "situation_awareness/ros/params/gps_ins_nodelet_params.hpp"

namespace situation_awareness {

/// The pose of the base in the world, with the covariance of its position (m, axes of the world) and of its attitude's
/// error (rad, axes of the base).
struct WorldPose {
  Eigen::Isometry3d T_world_base = Eigen::Isometry3d::Identity();
  Eigen::Matrix<double, 6, 6> covariance = Eigen::Matrix<double, 6, 6>::Zero();
};

/// Of the pose's x, y (m) and yaw (rad) in the axes of the world.
Eigen::Matrix3d planar_covariance(const WorldPose& pose);

/// What IMU and fixes say of the motion: a frame `odom`, in which the base goes on by gyroscopes and accelerations. It
/// drifts, and does not jump where a fix moves the pose; height, roll and pitch are those of the pose. With it, where
/// GPS and INS say that `odom` is in the world. Once the pose is ready it is followed back (GpsInsBacklog), for what
/// waited meanwhile. After a gap of the IMU all that begins anew, where the pose after the gap is in the `odom` before
/// it; after a jump of its stamps back, with another `odom`. Memory is bounded by kBacklog_s.
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

  bool is_ready() const { return ready_since_ns_ != StampOrder::kNone; }
  /// Before it, poses are of what came later; what was measured then waited for them.
  bool was_ready_at(std::int64_t stamp_ns) const { return stamp_ns >= ready_since_ns_; }
  /// Of the latest pose; StampOrder::kNone without one.
  std::int64_t stamp_ns() const { return known_.empty() ? StampOrder::kNone : known_.back().stamp_ns; }

  /// For MapAlignment, as it was known at the stamp. These two need a pose, and stamps that ascend: what is before is
  /// forgotten.
  InertialPlacement placement_at(std::int64_t stamp_ns, const Eigen::Isometry3d& T_odom_base,
                                 const Eigen::Isometry3d& T_odom_lidar);
  /// The pose by GPS and INS, or by the map where they know it worse than the map does: then x, y and yaw are the
  /// map's; height, roll and pitch stay.
  WorldPose pose_at(std::int64_t stamp_ns, const Eigen::Isometry3d& T_odom_base, const MapAlignment& alignment);

  /// Fixes that came after their patience was over.
  std::uint64_t late_fixes() const { return late_fixes_; }

  GpsInsInput& input() { return input_; }
  const GpsInsInput& input() const { return input_; }

 private:
  /// What was known at a stamp.
  struct Known {
    std::int64_t stamp_ns = 0;
    Eigen::Isometry3d T_world_odom;
    Eigen::Matrix<double, 6, 6> covariance;                   ///< as that of WorldPose
    Eigen::Vector3d v_odom_m_s, angular_velocity_odom_rad_s;  ///< of the base
    Eigen::Vector3d v_world_m_s;
    double velocity_sigma_m_s = 0.0;
  };

  /// A fix, and the stamp of the latest pose when it came in: what is known at a stamp does not depend on when it is
  /// asked for.
  template <class Fix>
  struct KnownFix {
    Fix fix;
    std::int64_t known_ns;
  };
  struct OdomPose {
    std::int64_t stamp_ns;
    Eigen::Isometry3d T_odom_base;
  };

  template <class Message>
  struct Waiting {
    Message msg;
    std::int64_t received_ns;
  };

  void follow();
  void use_fixes();
  void use_fix(const Waiting<sensor_msgs::NavSatFix>& fix);
  void place_fixes();
  const Known& known_at(std::int64_t stamp_ns);
  void begin(const GpsInsPose& ready, const std::vector<GpsInsPose>& earlier);
  void go_on(const GpsInsPose& pose);
  void restart(std::int64_t stamp_ns);

  GpsInsInput input_;
  Use use_;
  std::deque<Waiting<sensor_msgs::Imu>> samples_;              ///< until there is a filter
  std::deque<Waiting<sensor_msgs::NavSatFix>> waiting_fixes_;  ///< by stamp
  std::uint64_t late_fixes_ = 0;
  std::int64_t ready_since_ns_ = StampOrder::kNone;
  std::deque<Known> known_;
  std::deque<KnownFix<GeodeticFix>> fixes_;  ///< of which it is not known yet where the base was
  std::deque<OdomPose> odom_;                ///< where it was lately
  std::deque<KnownFix<PlacedFix>> placed_fixes_;
  Pose2 T_world_odom_begin_;  ///< where `odom` begins
  Eigen::Quaterniond q_odom_base_ = Eigen::Quaterniond::Identity();
  Eigen::Vector3d accelerometer_bias_m_s2_ = Eigen::Vector3d::Zero(), gyroscope_bias_rad_s_ = Eigen::Vector3d::Zero();
  Eigen::Vector3d rate_base_rad_s_ = Eigen::Vector3d::Zero();
  Eigen::Vector3d p_odom_m_ = Eigen::Vector3d::Zero(), v_odom_m_s_ = p_odom_m_, a_odom_m_s2_ = p_odom_m_;
};

}  // namespace situation_awareness

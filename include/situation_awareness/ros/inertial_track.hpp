// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstdint>
#include <deque>
#include <string>

#include <geometry_msgs/TransformStamped.h>
#include <nav_msgs/Odometry.h>
#include <Eigen/Core>
#include <Eigen/Geometry>

#include "situation_awareness/common/stamp_order.hpp"
#include "situation_awareness/pipeline/map_alignment.hpp"
#include "situation_awareness/pose/odometry_track.hpp"

namespace situation_awareness {

/// What a source of pose and velocity in the world, such as gps_ins, says of the motion alone: a frame `odom` in which
/// the base goes on by its velocity and its turn rates. It drifts, and does not jump where a fix moves the pose;
/// height, roll and pitch are those of the pose. Messages in the order of their stamps, live or of a bag.
class InertialTrack {
 public:
  /// What was known at a stamp.
  struct Known {
    std::int64_t stamp_ns = StampOrder::kNone;
    Eigen::Isometry3d T_world_base = Eigen::Isometry3d::Identity();
    Eigen::Isometry3d T_world_odom = Eigen::Isometry3d::Identity();
    /// Of the position and of the small rotation about the world's axes, as the message has it.
    Eigen::Matrix<double, 6, 6> covariance = Eigen::Matrix<double, 6, 6>::Zero();
    /// Of the base, in the axes of odom and of the world.
    Eigen::Vector3d v_odom_m_s = Eigen::Vector3d::Zero(), v_world_m_s = Eigen::Vector3d::Zero();
    double velocity_sigma_m_s = 0.0;  ///< in the base's axes, in any horizontal direction
  };

  /// A stamp that goes back by more than `reset_time_jump_s` is a restart, by which `odom` begins anew.
  explicit InertialTrack(double reset_time_jump_s) : order_(reset_time_jump_s) {}

  /// Takes a message and makes `transform`, that of its pose, that from odom to base; the frame's name is left alone.
  /// Throws std::invalid_argument if a number is not finite or a variance is negative; it is then not used.
  OdometryTrack::Verdict add(const nav_msgs::Odometry& msg, geometry_msgs::TransformStamped& transform);

  bool empty() const { return known_.empty(); }

  /// The latest that is not after a stamp, or else the first that is kept; not for an empty track. What is before is
  /// forgotten.
  const Known& known_at(std::int64_t stamp_ns);

 private:
  StampOrder order_;
  std::deque<Known> known_;
  double odom_yaw_rad_ = 0.0;
  Eigen::Vector3d p_odom_m_ = Eigen::Vector3d::Zero();
};

/// For MapAlignment.
InertialPlacement placement_of(const InertialTrack::Known& known);

}  // namespace situation_awareness

// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <string>

#include <geometry_msgs/Pose.h>
#include <geometry_msgs/PoseWithCovarianceStamped.h>
#include <geometry_msgs/Transform.h>
#include <geometry_msgs/TransformStamped.h>
#include <nav_msgs/Odometry.h>
#include <Eigen/Geometry>

#include "situation_awareness/geometry/pose2.hpp"
#include "situation_awareness/pose/reflector_localization.hpp"

namespace situation_awareness {

/// Frames of odometry, as tf2 names them; empty while unknown.
struct OdometryFrames {
  std::string odom, base;
};

/// Reason why a message of odometry is not used, regardless of the messages before it; empty if it is. The texts are
/// fixed, for counters.
std::string odometry_msg_defect(const nav_msgs::Odometry& msg);

/// Reason why a message of odometry on `topic` is not of the frames that are known: it names none, and none is known
/// ("/odom has no child_frame_id"), or another.
std::string odometry_frame_defect(const nav_msgs::Odometry& msg, const OdometryFrames& known, const std::string& topic);

/// The pose of a message of odometry as a transform from its frame to its child frame.
geometry_msgs::TransformStamped transform_from_odometry(const nav_msgs::Odometry& msg);

geometry_msgs::Pose pose_of(const geometry_msgs::Transform& transform);

/// The part in the plane of the pose of a message: x, y and yaw.
Pose2 pose2_of(const geometry_msgs::Pose& pose);
/// Of x, y and yaw, out of that of all six; neither checked.
Eigen::Matrix3d planar_covariance(const geometry_msgs::PoseWithCovariance& pose);

/// Height, roll and pitch are those of the plane, with no variance.
geometry_msgs::PoseWithCovarianceStamped pose_to_msg(const LocalizedPose& pose, const std::string& world_frame);

/// A pose given by hand, with the standard deviation of its position in its worse direction.
struct GivenPose {
  Pose2 T_world_base;
  double sigma_m = 0.0;
  double sigma_rad = 0.0;
};

/// Throws std::invalid_argument if a number is not finite, the quaternion is not a rotation or a variance is negative.
GivenPose given_pose_from_msg(const geometry_msgs::PoseWithCovariance& msg);

}  // namespace situation_awareness

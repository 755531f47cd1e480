// SPDX-License-Identifier: BSD-3-Clause
#include "situation_awareness/ros/convert/odometry.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <exception>
#include <stdexcept>

#include "situation_awareness/ros/convert/poses.hpp"
#include "situation_awareness/ros/convert/time.hpp"

namespace situation_awareness {
namespace {

/// Index in the covariance of a message, row by row, of variables from (x, y, z, roll, pitch, yaw).
constexpr std::array<std::size_t, 3> kPlanar = {0, 1, 5};
constexpr std::size_t covariance_index(std::size_t row, std::size_t column) { return 6 * row + column; }

geometry_msgs::Transform transform_of(const geometry_msgs::Pose& pose) {
  geometry_msgs::Transform transform;
  transform.translation.x = pose.position.x;
  transform.translation.y = pose.position.y;
  transform.translation.z = pose.position.z;
  transform.rotation = pose.orientation;
  return transform;
}

}  // namespace

std::string odometry_msg_defect(const nav_msgs::Odometry& msg) {
  if (msg.header.stamp.isZero()) return "odometry with a stamp of zero";
  try {
    isometry_from_msg(transform_of(msg.pose.pose));
  } catch (const std::exception&) {
    return "odometry not a finite pose";
  }
  return "";
}

std::string odometry_frame_defect(const nav_msgs::Odometry& msg, const OdometryFrames& known,
                                  const std::string& topic) {
  const std::string odom = tf2_frame(msg.header.frame_id), base = tf2_frame(msg.child_frame_id);
  if (known.odom.empty() && odom.empty()) return topic + " has no frame_id";
  if (known.base.empty() && base.empty()) return topic + " has no child_frame_id";
  const auto is_other = [](const std::string& frame, const std::string& known_frame) {
    return !known_frame.empty() && !frame.empty() && frame != known_frame;
  };
  return is_other(odom, known.odom) || is_other(base, known.base) ? "odometry in another frame" : "";
}

geometry_msgs::TransformStamped transform_from_odometry(const nav_msgs::Odometry& msg) {
  geometry_msgs::TransformStamped transform;
  transform.header = msg.header;
  transform.child_frame_id = msg.child_frame_id;
  transform.transform = transform_of(msg.pose.pose);
  return transform;
}

geometry_msgs::Pose pose_of(const geometry_msgs::Transform& transform) {
  geometry_msgs::Pose pose;
  pose.position.x = transform.translation.x;
  pose.position.y = transform.translation.y;
  pose.position.z = transform.translation.z;
  pose.orientation = transform.rotation;
  return pose;
}

Pose2 pose2_of(const geometry_msgs::Pose& pose) {
  const geometry_msgs::Quaternion& q = pose.orientation;
  return {{pose.position.x, pose.position.y},
          std::atan2(2.0 * (q.w * q.z + q.x * q.y), 1.0 - 2.0 * (q.y * q.y + q.z * q.z))};
}

Eigen::Matrix3d planar_covariance(const geometry_msgs::PoseWithCovariance& pose) {
  Eigen::Matrix3d covariance;
  for (std::size_t row = 0; row < kPlanar.size(); ++row) {
    for (std::size_t column = 0; column < kPlanar.size(); ++column) {
      covariance(static_cast<Eigen::Index>(row), static_cast<Eigen::Index>(column)) =
          pose.covariance[covariance_index(kPlanar[row], kPlanar[column])];
    }
  }
  return covariance;
}

geometry_msgs::PoseWithCovarianceStamped pose_to_msg(const LocalizedPose& pose, const std::string& world_frame) {
  geometry_msgs::PoseWithCovarianceStamped msg;
  msg.header.stamp = to_ros_time(pose.stamp_ns);
  msg.header.frame_id = world_frame;
  const Pose2& T_world_base = pose.T_world_base.x;
  msg.pose.pose.position.x = T_world_base.translation_m.x();
  msg.pose.pose.position.y = T_world_base.translation_m.y();
  msg.pose.pose.orientation.z = std::sin(0.5 * T_world_base.yaw_rad);
  msg.pose.pose.orientation.w = std::cos(0.5 * T_world_base.yaw_rad);
  for (std::size_t row = 0; row < kPlanar.size(); ++row) {
    for (std::size_t column = 0; column < kPlanar.size(); ++column) {
      msg.pose.covariance[covariance_index(kPlanar[row], kPlanar[column])] =
          pose.covariance_world(static_cast<Eigen::Index>(row), static_cast<Eigen::Index>(column));
    }
  }
  return msg;
}

GivenPose given_pose_from_msg(const geometry_msgs::PoseWithCovariance& msg) {
  GivenPose given;
  given.T_world_base = pose2_of(isometry_from_msg(transform_of(msg.pose)));
  const auto variance = [&msg](std::size_t i) {
    const double value = msg.covariance[covariance_index(kPlanar[i], kPlanar[i])];
    if (!(value >= 0.0) || !std::isfinite(value)) {
      throw std::invalid_argument("a variance is not a finite number >= 0");
    }
    return value;
  };
  given.sigma_m = std::sqrt(std::max(variance(0), variance(1)));
  given.sigma_rad = std::sqrt(variance(2));
  return given;
}

}  // namespace situation_awareness

// SPDX-License-Identifier: BSD-3-Clause
#include "situation_awareness/ros/convert/poses.hpp"

#include <cmath>
#include <stdexcept>

#include "situation_awareness/ros/convert/time.hpp"

namespace situation_awareness {

Eigen::Isometry3d isometry_from_msg(const geometry_msgs::Transform& msg) {
  const Eigen::Vector3d translation(msg.translation.x, msg.translation.y, msg.translation.z);
  const Eigen::Quaterniond rotation(msg.rotation.w, msg.rotation.x, msg.rotation.y, msg.rotation.z);
  if (!translation.allFinite() || !rotation.coeffs().allFinite()) {
    throw std::invalid_argument("transform is not finite");
  }
  constexpr double kNormTolerance = 0.01;
  if (std::abs(rotation.norm() - 1.0) > kNormTolerance) {
    throw std::invalid_argument("quaternion of the transform is not normalised");
  }
  Eigen::Isometry3d T = Eigen::Isometry3d::Identity();
  T.linear() = rotation.normalized().toRotationMatrix();
  T.translation() = translation;
  return T;
}

geometry_msgs::Transform isometry_to_msg(const Eigen::Isometry3d& T) {
  const Eigen::Quaterniond rotation(T.linear());
  geometry_msgs::Transform msg;
  msg.translation.x = T.translation().x();
  msg.translation.y = T.translation().y();
  msg.translation.z = T.translation().z();
  msg.rotation.x = rotation.x();
  msg.rotation.y = rotation.y();
  msg.rotation.z = rotation.z();
  msg.rotation.w = rotation.w();
  return msg;
}

geometry_msgs::TransformStamped transform_to_msg(const Eigen::Isometry3d& T_parent_child, std::int64_t stamp_ns,
                                                 const std::string& parent_frame, const std::string& child_frame) {
  geometry_msgs::TransformStamped msg;
  msg.header.stamp = to_ros_time(stamp_ns);
  msg.header.frame_id = parent_frame;
  msg.child_frame_id = child_frame;
  msg.transform = isometry_to_msg(T_parent_child);
  return msg;
}

LevelFrame level_to_msg(const Pose2& T_world_level, double height_world_m) {
  LevelFrame msg;
  msg.x = T_world_level.translation_m.x();
  msg.y = T_world_level.translation_m.y();
  msg.z = height_world_m;
  msg.yaw = T_world_level.yaw_rad;
  return msg;
}

void level_from_msg(const LevelFrame& msg, Pose2& T_world_level, double& height_world_m) {
  if (!std::isfinite(msg.x + msg.y + msg.z + msg.yaw)) throw std::invalid_argument("level frame is not finite");
  T_world_level = {{msg.x, msg.y}, msg.yaw};
  height_world_m = msg.z;
}

std::string tf2_frame(const std::string& frame) {
  return !frame.empty() && frame.front() == '/' ? frame.substr(1) : frame;
}

}  // namespace situation_awareness

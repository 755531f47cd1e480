// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <Eigen/Core>
#include <Eigen/Geometry>

namespace situation_awareness {

/// Pose in the plane, an element of SE(2). `T_a_b` maps points of frame b into frame a: `p_a = T_a_b * p_b`.
struct Pose2 {
  Eigen::Vector2d translation_m = Eigen::Vector2d::Zero();
  double yaw_rad = 0.0;

  Eigen::Matrix2d rotation() const { return Eigen::Rotation2Dd(yaw_rad).toRotationMatrix(); }
};

inline Eigen::Vector2d operator*(const Pose2& T_a_b, const Eigen::Vector2d& p_b) {
  return T_a_b.rotation() * p_b + T_a_b.translation_m;
}

inline Pose2 operator*(const Pose2& T_a_b, const Pose2& T_b_c) {
  return {T_a_b * T_b_c.translation_m, T_a_b.yaw_rad + T_b_c.yaw_rad};
}

inline Pose2 inverse(const Pose2& T_a_b) {
  return {-(T_a_b.rotation().transpose() * T_a_b.translation_m), -T_a_b.yaw_rad};
}

/// The same in space: heights stay as they are.
inline Eigen::Isometry3d isometry_in_plane(const Pose2& T_a_b) {
  Eigen::Isometry3d T = Eigen::Isometry3d::Identity();
  T.translation().head<2>() = T_a_b.translation_m;
  T.linear() = Eigen::AngleAxisd(T_a_b.yaw_rad, Eigen::Vector3d::UnitZ()).toRotationMatrix();
  return T;
}

/// The part of a pose in the plane: x, y, and the yaw of its x axis.
inline Pose2 pose2_of(const Eigen::Isometry3d& T_a_b) {
  return {T_a_b.translation().head<2>(), std::atan2(T_a_b(1, 0), T_a_b(0, 0))};
}

/// The motion that turns by a yaw (rad) about a place, and moves that by x and y (m).
inline Pose2 motion_about(const Eigen::Vector2d& center_m, const Eigen::Vector3d& motion) {
  Pose2 T = {Eigen::Vector2d::Zero(), motion(2)};
  T.translation_m = center_m + motion.head<2>() - T.rotation() * center_m;
  return T;
}

}  // namespace situation_awareness

// SPDX-License-Identifier: BSD-3-Clause
#include "situation_awareness/ros/inertial_navigation.hpp"

#include <algorithm>
#include <cmath>
#include <utility>

#include "situation_awareness/common/time.hpp"
#include "situation_awareness/ros/convert/odometry.hpp"
#include "situation_awareness/ros/convert/poses.hpp"

namespace situation_awareness {
namespace {

/// The pose is that by the map where its variance is so much less than that by GPS and INS.
constexpr double kWorseThanMap = 1.5;
/// Time for which it is kept what was known, where nothing asks for it: no scan waits longer.
constexpr double kKnownFor_s = 2.0 * InertialNavigation::kBacklog_s;
/// Least cosine of the pitch, by which a yaw rate is divided.
constexpr double kLeastCosine = 0.1;

Eigen::Matrix3d rotation_about_vertical(double angle_rad) {
  return Eigen::AngleAxisd(angle_rad, Eigen::Vector3d::UnitZ()).toRotationMatrix();
}

/// About the vertical, of Rz(yaw) Ry(pitch) Rx(roll).
double yaw_rate_of(const GpsInsPose& pose) {
  const Eigen::Matrix3d R = pose.T_world_base.linear();
  const double roll_rad = std::atan2(R(2, 1), R(2, 2));
  const double cos_pitch = std::hypot(R(2, 1), R(2, 2));
  return (std::sin(roll_rad) * pose.angular_velocity_base_rad_s.y() +
          std::cos(roll_rad) * pose.angular_velocity_base_rad_s.z()) /
         std::max(cos_pitch, kLeastCosine);
}

void place_by_map(const MapAlignment& alignment, const Eigen::Isometry3d& T_world_odom,
                  const Eigen::Isometry3d& T_odom_base, WorldPose& pose) {
  if (!alignment.has_begun()) return;
  const Eigen::Matrix3d by_map = alignment.covariance_world(), before = planar_covariance(pose);
  if (before.topLeftCorner<2, 2>().trace() < kWorseThanMap * by_map.topLeftCorner<2, 2>().trace()) return;
  const Pose2 T_map = alignment.T_world_odom();
  Eigen::Isometry3d T_new_odom = Eigen::Isometry3d::Identity();
  T_new_odom.translation() << T_map.translation_m, T_world_odom.translation().z();
  T_new_odom.linear() = rotation_about_vertical(T_map.yaw_rad);
  pose.T_world_base = T_new_odom * T_odom_base;
  // The error of the yaw is one about the vertical, along the third row of R in the base.
  const Eigen::Vector3d up_base = pose.T_world_base.linear().row(2).transpose();
  Eigen::Matrix<double, 6, 3> J = Eigen::Matrix<double, 6, 3>::Zero();
  J(0, 0) = J(1, 1) = 1.0;
  J.block<3, 1>(3, 2) = up_base;
  const Eigen::Matrix3d level = Eigen::Matrix3d::Identity() - up_base * up_base.transpose();
  Eigen::Matrix<double, 6, 6> kept = Eigen::Matrix<double, 6, 6>::Zero();
  kept(2, 2) = pose.covariance(2, 2);
  kept.bottomRightCorner<3, 3>() = level * pose.covariance.bottomRightCorner<3, 3>() * level;
  pose.covariance = kept + J * by_map * J.transpose();
}

}  // namespace

Eigen::Matrix3d planar_covariance(const WorldPose& pose) {
  Eigen::Matrix<double, 3, 6> J = Eigen::Matrix<double, 3, 6>::Zero();
  J(0, 0) = J(1, 1) = 1.0;
  J.row(2).tail<3>() = pose.T_world_base.linear().row(2);
  return J * pose.covariance * J.transpose();
}

InertialNavigation::InertialNavigation(const GpsInsNodeletParams& params, const tf2::BufferCore& tf, Use use)
    : input_(params, tf), use_(std::move(use)) {
  input_.keep_backlog(kBacklog_s);
}

std::string InertialNavigation::add_imu(const sensor_msgs::Imu& msg) {
  std::string reason = input_.add_imu(msg);
  const GpsIns* const filter = input_.filter();
  if (!reason.empty() || filter == nullptr) return reason;
  if (!filter->is_ready()) {
    if (is_ready()) restart(filter->stamp_ns());
    return reason;
  }
  const GpsInsPose pose = filter->pose();
  if (!pose.is_ready) return reason;
  if (!is_ready()) {
    ready_since_ns_ = pose.stamp_ns;
    for (const GpsInsPose& earlier : input_.backlog_poses(pose)) go_on(earlier);
  }
  go_on(pose);
  return reason;
}

void InertialNavigation::restart(std::int64_t stamp_ns) {
  use_.restart();
  T_world_odom_begin_ =
      !known_.empty() && stamp_ns > known_.back().stamp_ns ? pose2_of(known_.back().T_world_odom) : Pose2{};
  ready_since_ns_ = StampOrder::kNone;
  known_.clear();
}

/// The next pose in order.
void InertialNavigation::go_on(const GpsInsPose& pose) {
  if (!known_.empty() && pose.stamp_ns <= known_.back().stamp_ns) return;
  const Eigen::Matrix3d R_world_base = pose.T_world_base.linear();
  const double yaw_rad = pose2_of(pose.T_world_base).yaw_rad;
  double step_s = 0.0;
  if (known_.empty()) {
    const Pose2 T_odom_base = inverse(T_world_odom_begin_) * pose2_of(pose.T_world_base);
    odom_yaw_rad_ = T_odom_base.yaw_rad;
    p_odom_m_.head<2>() = T_odom_base.translation_m;
    v_odom_m_s_ = rotation_about_vertical(-T_world_odom_begin_.yaw_rad) * pose.velocity_world_m_s;
  } else {
    step_s = seconds_between(known_.back().stamp_ns, pose.stamp_ns);
  }
  odom_yaw_rad_ += step_s * yaw_rate_of(pose);
  const Eigen::Matrix3d R_odom_base = rotation_about_vertical(odom_yaw_rad_ - yaw_rad) * R_world_base;
  const Eigen::Vector3d a_odom_m_s2 =
      R_odom_base * pose.specific_force_base_m_s2 - kStandardGravity_m_s2 * Eigen::Vector3d::UnitZ();
  const Eigen::Vector3d change_m_s = 0.5 * step_s * (a_odom_m_s2_ + a_odom_m_s2);
  p_odom_m_ += step_s * (v_odom_m_s_ + 0.5 * change_m_s);
  v_odom_m_s_ += change_m_s;
  a_odom_m_s2_ = a_odom_m_s2;
  p_odom_m_.z() = pose.T_world_base.translation().z();
  Eigen::Isometry3d T_odom_base = Eigen::Isometry3d::Identity();
  T_odom_base.translation() = p_odom_m_;
  T_odom_base.linear() = R_odom_base;
  const double yaw_variance =
      R_world_base.row(2) * pose.covariance.bottomRightCorner<3, 3>() * R_world_base.row(2).transpose();
  const double velocity_variance = pose.velocity_covariance.topLeftCorner<2, 2>().diagonal().maxCoeff() +
                                   pose.velocity_world_m_s.head<2>().squaredNorm() * yaw_variance;
  known_.push_back({pose.stamp_ns, pose.T_world_base * T_odom_base.inverse(), pose.covariance, v_odom_m_s_,
                    R_odom_base * pose.angular_velocity_base_rad_s, pose.velocity_world_m_s,
                    std::sqrt(velocity_variance)});
  while (seconds_between(known_.front().stamp_ns, pose.stamp_ns) > kKnownFor_s) known_.pop_front();
  use_.add(transform_to_msg(T_odom_base, pose.stamp_ns, "", ""));
}

/// The latest that is not after the stamp, or else the first.
const InertialNavigation::Known& InertialNavigation::known_at(std::int64_t stamp_ns) {
  while (known_.size() > 1 && known_[1].stamp_ns <= stamp_ns) known_.pop_front();
  return known_.front();
}

InertialPlacement InertialNavigation::placement_at(std::int64_t stamp_ns, const Eigen::Isometry3d& T_odom_base,
                                                   const Eigen::Isometry3d& T_odom_lidar) {
  const Known& known = known_at(stamp_ns);
  const Eigen::Vector3d of_arm_m_s =
      known.angular_velocity_odom_rad_s.cross(T_odom_lidar.translation() - T_odom_base.translation());
  InertialPlacement placement;
  placement.T_world_odom = pose2_of(known.T_world_odom);
  placement.pose_covariance = planar_covariance({known.T_world_odom * T_odom_base, known.covariance});
  placement.v_odom_m_s = (known.v_odom_m_s + of_arm_m_s).head<2>();
  placement.v_world_m_s = (known.v_world_m_s + known.T_world_odom.linear() * of_arm_m_s).head<2>();
  placement.velocity_sigma_m_s = known.velocity_sigma_m_s;
  return placement;
}

WorldPose InertialNavigation::pose_at(std::int64_t stamp_ns, const Eigen::Isometry3d& T_odom_base,
                                      const MapAlignment& alignment) {
  const Known& known = known_at(stamp_ns);
  WorldPose pose{known.T_world_odom * T_odom_base, known.covariance};
  place_by_map(alignment, known.T_world_odom, T_odom_base, pose);
  return pose;
}

}  // namespace situation_awareness

// SPDX-License-Identifier: BSD-3-Clause
#include "situation_awareness/registration/inertial_odometry.hpp"

#include <algorithm>
#include <cmath>

#include "situation_awareness/common/time.hpp"
#include "situation_awareness/geometry/lie_groups.hpp"
#include "situation_awareness/pose/inertial_motion.hpp"
#include "situation_awareness/pose/local_world.hpp"

namespace situation_awareness {
namespace {

/// s. Time for which fixes are kept that cannot be placed yet.
constexpr double kFixesKept_s = 30.0;
/// In `odom` biases and tilt are those of the filter when the pose became ready, followed back to where `odom` begins,
/// and follow the filter from then on with this time constant: what a fix changes in them shows up slowly, and errors
/// of them are nearly constant, so that the map tells them.
constexpr double kFollow_s = 100.0;

Eigen::Matrix3d rotation_about_vertical(double angle_rad) {
  return Eigen::AngleAxisd(angle_rad, Eigen::Vector3d::UnitZ()).toRotationMatrix();
}

void place_by_map(const MapAlignment& alignment, const Eigen::Isometry3d& T_world_odom,
                  const Eigen::Isometry3d& T_odom_base, WorldPose& pose) {
  const auto by_map = alignment.better_place(planar_covariance(pose));
  if (!by_map) return;
  Eigen::Isometry3d T_new_odom = Eigen::Isometry3d::Identity();
  T_new_odom.translation() << by_map->T_world_odom.translation_m, T_world_odom.translation().z();
  T_new_odom.linear() = rotation_about_vertical(by_map->T_world_odom.yaw_rad);
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
  pose.covariance = kept + J * by_map->covariance * J.transpose();
}

/// Returns the rate of turn as the gyroscope measures it, with its bias.
Eigen::Vector3d measured_rate_rad_s(const GpsInsPose& pose) {
  return pose.angular_velocity_base_rad_s + pose.gyroscope_bias_rad_s;
}

/// Returns the attitude of `ready`, followed back by the gyroscope to the first of the poses before it.
Eigen::Quaterniond followed_back(const GpsInsPose& ready, const std::vector<GpsInsPose>& earlier) {
  Eigen::Quaterniond q_world_base(ready.T_world_base.linear());
  const GpsInsPose* later = &ready;
  for (auto pose = earlier.rbegin(); pose != earlier.rend(); ++pose) {
    const Eigen::Vector3d rate_rad_s =
        0.5 * (measured_rate_rad_s(*pose) + measured_rate_rad_s(*later)) - ready.gyroscope_bias_rad_s;
    q_world_base = q_world_base * exp_so3(-seconds_between(pose->stamp_ns, later->stamp_ns) * rate_rad_s);
    later = &*pose;
  }
  return q_world_base;
}

}  // namespace

Eigen::Matrix3d planar_covariance(const WorldPose& pose) {
  Eigen::Matrix<double, 3, 6> J = Eigen::Matrix<double, 3, 6>::Zero();
  J(0, 0) = J(1, 1) = 1.0;
  J.row(2).tail<3>() = pose.T_world_base.linear().row(2);
  return J * pose.covariance * J.transpose();
}

void InertialOdometry::begin(const GpsInsPose& ready, const std::vector<GpsInsPose>& earlier) {
  ready_since_ns_ = ready.stamp_ns;
  const GpsInsPose& first = earlier.empty() ? ready : earlier.front();
  const Pose2 T_odom_base = inverse(T_world_odom_begin_) * pose2_of(first.T_world_base);
  const Eigen::Quaterniond q_world_base = followed_back(ready, earlier);
  q_odom_base_ = rotation_about_vertical(T_odom_base.yaw_rad - yaw_of(q_world_base)) * q_world_base;
  accelerometer_bias_m_s2_ = ready.accelerometer_bias_m_s2;
  gyroscope_bias_rad_s_ = ready.gyroscope_bias_rad_s;
  p_odom_m_.head<2>() = T_odom_base.translation_m;
  v_odom_m_s_ = rotation_about_vertical(-T_world_odom_begin_.yaw_rad) * first.velocity_world_m_s;
}

std::optional<InertialOdometry::Pose> InertialOdometry::add(const GpsInsPose& pose) {
  if (!known_.empty() && pose.stamp_ns <= known_.back().stamp_ns) return std::nullopt;
  const double step_s = known_.empty() ? 0.0 : seconds_between(known_.back().stamp_ns, pose.stamp_ns);
  turn(pose, step_s);
  const Eigen::Isometry3d T_odom_base = move(pose, step_s);
  const Eigen::Matrix3d R_world_base = pose.T_world_base.linear();
  const double yaw_variance =
      R_world_base.row(2) * pose.covariance.bottomRightCorner<3, 3>() * R_world_base.row(2).transpose();
  const double velocity_variance = pose.velocity_covariance.topLeftCorner<2, 2>().diagonal().maxCoeff() +
                                   pose.velocity_world_m_s.head<2>().squaredNorm() * yaw_variance;
  known_.push_back({pose.stamp_ns, pose.T_world_base * T_odom_base.inverse(), pose.covariance, v_odom_m_s_,
                    T_odom_base.linear() * rate_base_rad_s_, pose.velocity_world_m_s, std::sqrt(velocity_variance)});
  while (seconds_between(known_.front().stamp_ns, pose.stamp_ns) > kept_s_) known_.pop_front();
  odom_.push_back({pose.stamp_ns, T_odom_base});
  return odom_.back();
}

/// Turns the base by the gyroscope; biases and tilt follow those of the filter.
void InertialOdometry::turn(const GpsInsPose& pose, double step_s) {
  if (!known_.empty()) {
    const double part = pose.stamp_ns > ready_since_ns_ ? std::min(step_s / kFollow_s, 1.0) : 0.0;
    accelerometer_bias_m_s2_ += part * (pose.accelerometer_bias_m_s2 - accelerometer_bias_m_s2_);
    gyroscope_bias_rad_s_ += part * (pose.gyroscope_bias_rad_s - gyroscope_bias_rad_s_);
    const Eigen::Vector3d rate_rad_s = measured_rate_rad_s(pose) - gyroscope_bias_rad_s_;
    q_odom_base_ = q_odom_base_ * exp_so3(0.5 * step_s * (rate_base_rad_s_ + rate_rad_s));
    const Eigen::Vector3d up = q_odom_base_.toRotationMatrix().row(2).transpose();
    const Eigen::Vector3d up_by_filter = pose.T_world_base.linear().row(2).transpose();
    q_odom_base_ = (q_odom_base_ * exp_so3(part * up_by_filter.cross(up))).normalized();
  }
  rate_base_rad_s_ = measured_rate_rad_s(pose) - gyroscope_bias_rad_s_;
}

/// Moves the base by the accelerometer. Returns its pose in `odom`.
Eigen::Isometry3d InertialOdometry::move(const GpsInsPose& pose, double step_s) {
  const Eigen::Vector3d force_m_s2 = pose.specific_force_base_m_s2 + pose.accelerometer_bias_m_s2;
  const Eigen::Vector3d a_odom_m_s2 =
      q_odom_base_ * (force_m_s2 - accelerometer_bias_m_s2_) - kStandardGravity_m_s2 * Eigen::Vector3d::UnitZ();
  const Eigen::Vector3d change_m_s = 0.5 * step_s * (a_odom_m_s2_ + a_odom_m_s2);
  p_odom_m_ += step_s * (v_odom_m_s_ + 0.5 * change_m_s);
  v_odom_m_s_ += change_m_s;
  a_odom_m_s2_ = a_odom_m_s2;
  p_odom_m_.z() = pose.T_world_base.translation().z();
  const double yaw_rad = pose2_of(pose.T_world_base).yaw_rad;
  Eigen::Isometry3d T_odom_base = Eigen::Isometry3d::Identity();
  T_odom_base.translation() = p_odom_m_;
  T_odom_base.linear() = rotation_about_vertical(yaw_of(q_odom_base_) - yaw_rad) * pose.T_world_base.linear();
  return T_odom_base;
}

void InertialOdometry::add_fix(const GeodeticFix& fix, std::int64_t known_ns) {
  fixes_.push_back({fix, known_ns});
  while (std::abs(seconds_between(fixes_.front().fix.stamp_ns, fix.stamp_ns)) > kFixesKept_s) fixes_.pop_front();
}

void InertialOdometry::place_fixes(const GeodeticPosition& origin, const Eigen::Vector3d& antenna_base_m) {
  if (odom_.empty()) return;
  while (!fixes_.empty() && fixes_.front().fix.stamp_ns <= odom_.back().stamp_ns) {
    const auto [fix, known_ns] = fixes_.front();
    fixes_.pop_front();
    if (fix.stamp_ns < odom_.front().stamp_ns ||
        (!placed_fixes_.empty() && fix.stamp_ns <= placed_fixes_.back().fix.stamp_ns)) {
      continue;
    }
    const auto then =
        std::lower_bound(odom_.begin(), odom_.end(), fix.stamp_ns,
                         [](const Pose& pose, std::int64_t stamp_ns) { return pose.stamp_ns < stamp_ns; });
    const Eigen::Vector3d antenna_m = then->T_odom_base * antenna_base_m;
    const Eigen::Vector3d fix_world_m = local_position(origin, fix.position);
    placed_fixes_.push_back(
        {{fix.stamp_ns, antenna_m.head<2>(), fix_world_m.head<2>(), fix.covariance_m2.diagonal().head<2>()}, known_ns});
  }
  const std::int64_t latest_ns = odom_.back().stamp_ns;
  while (seconds_between(odom_.front().stamp_ns, latest_ns) > kLatestFix_s) odom_.pop_front();
  while (!placed_fixes_.empty() && seconds_between(placed_fixes_.front().fix.stamp_ns, latest_ns) > kept_s_) {
    placed_fixes_.pop_front();
  }
}

void InertialOdometry::restart(std::int64_t stamp_ns) {
  T_world_odom_begin_ =
      !known_.empty() && stamp_ns > known_.back().stamp_ns ? pose2_of(known_.back().T_world_odom) : Pose2{};
  ready_since_ns_ = StampOrder::kNone;
  known_.clear();
  fixes_.clear();
  odom_.clear();
  placed_fixes_.clear();
}

/// The latest that is not after the stamp, or else the first.
const InertialOdometry::Known& InertialOdometry::known_at(std::int64_t stamp_ns) {
  while (known_.size() > 1 && known_[1].stamp_ns <= stamp_ns) known_.pop_front();
  return known_.front();
}

InertialPlacement InertialOdometry::placement_at(std::int64_t stamp_ns, const Eigen::Isometry3d& T_odom_base,
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
  for (; !placed_fixes_.empty() && placed_fixes_.front().known_ns <= stamp_ns; placed_fixes_.pop_front()) {
    placement.fixes.push_back(placed_fixes_.front().fix);
  }
  return placement;
}

WorldPose InertialOdometry::pose_at(std::int64_t stamp_ns, const Eigen::Isometry3d& T_odom_base,
                                    const MapAlignment& alignment) {
  const Known& known = known_at(stamp_ns);
  WorldPose pose{known.T_world_odom * T_odom_base, known.covariance};
  place_by_map(alignment, known.T_world_odom, T_odom_base, pose);
  return pose;
}

}  // namespace situation_awareness

// SPDX-License-Identifier: BSD-3-Clause
#include "situation_awareness/ros/inertial_track.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <stdexcept>

#include "situation_awareness/common/time.hpp"
#include "situation_awareness/ros/convert/odometry.hpp"
#include "situation_awareness/ros/convert/poses.hpp"
#include "situation_awareness/ros/convert/time.hpp"

namespace situation_awareness {
namespace {

/// Poses that are kept: of 5 s at 400 Hz.
constexpr std::size_t kMostKnown = 2000;
/// Least cosine of the pitch, by which a yaw rate is divided.
constexpr double kLeastCosine = 0.1;

/// About the vertical, of Rz(yaw) Ry(pitch) Rx(roll).
double yaw_rate(const Eigen::Matrix3d& R_world_base, const Eigen::Vector3d& angular_velocity_base_rad_s) {
  const double roll_rad = std::atan2(R_world_base(2, 1), R_world_base(2, 2));
  const double cos_pitch = std::hypot(R_world_base(2, 1), R_world_base(2, 2));
  return (std::sin(roll_rad) * angular_velocity_base_rad_s.y() + std::cos(roll_rad) * angular_velocity_base_rad_s.z()) /
         std::max(cos_pitch, kLeastCosine);
}

Eigen::Vector3d vector_of(const geometry_msgs::Vector3& v) { return {v.x, v.y, v.z}; }

Eigen::AngleAxisd about_vertical(double angle_rad) { return {angle_rad, Eigen::Vector3d::UnitZ()}; }

}  // namespace

OdometryTrack::Verdict InertialTrack::add(const nav_msgs::Odometry& msg, geometry_msgs::TransformStamped& transform) {
  using Covariance = Eigen::Matrix<double, 6, 6, Eigen::RowMajor>;
  Known known;
  known.T_world_base = isometry_from_msg(transform.transform);
  known.covariance = Eigen::Map<const Covariance>(msg.pose.covariance.data());
  const Eigen::Map<const Covariance> twist_covariance(msg.twist.covariance.data());
  const Eigen::Vector3d velocity_base_m_s = vector_of(msg.twist.twist.linear);
  const Eigen::Vector3d turn_base_rad_s = vector_of(msg.twist.twist.angular);
  if (!known.covariance.allFinite() || !twist_covariance.allFinite() || !velocity_base_m_s.allFinite() ||
      !turn_base_rad_s.allFinite()) {
    throw std::invalid_argument("odometry not finite");
  }
  if (known.covariance.diagonal().minCoeff() < 0.0 || twist_covariance.diagonal().minCoeff() < 0.0) {
    throw std::invalid_argument("odometry with a negative variance");
  }
  // Without a variance there would be no weight.
  if (!(known.covariance(0, 0) > 0.0 && known.covariance(1, 1) > 0.0 && known.covariance(5, 5) > 0.0)) {
    throw std::invalid_argument("odometry without a covariance");
  }
  known.velocity_sigma_m_s = std::sqrt(std::max(twist_covariance(0, 0), twist_covariance(1, 1)));
  known.stamp_ns = to_nanoseconds(msg.header.stamp);
  const std::int64_t before_ns = order_.latest_ns();
  const StampOrder::Verdict verdict = order_.judge(known.stamp_ns);
  if (verdict == StampOrder::Verdict::kRefused) return OdometryTrack::Verdict::kRefused;
  const bool restarted = verdict == StampOrder::Verdict::kRestart;
  if (restarted) known_.clear();

  const Eigen::Matrix3d R_world_base = known.T_world_base.linear();
  const double yaw_rad = pose2_of(known.T_world_base).yaw_rad;
  if (known_.empty()) {
    odom_yaw_rad_ = yaw_rad;
    p_odom_m_ = known.T_world_base.translation();
  } else {
    // The turn by the gyroscopes, and the way by the velocity as seen from the base.
    const double step_s = seconds_between(before_ns, known.stamp_ns);
    const double yaw_before_rad = odom_yaw_rad_;
    odom_yaw_rad_ += step_s * yaw_rate(R_world_base, turn_base_rad_s);
    p_odom_m_ += step_s * (about_vertical(0.5 * (yaw_before_rad + odom_yaw_rad_) - yaw_rad) *
                           (R_world_base * velocity_base_m_s));
  }
  p_odom_m_.z() = known.T_world_base.translation().z();
  Eigen::Isometry3d T_odom_base = Eigen::Isometry3d::Identity();
  T_odom_base.translation() = p_odom_m_;
  T_odom_base.linear() = about_vertical(odom_yaw_rad_ - yaw_rad).toRotationMatrix() * R_world_base;
  known.T_world_odom = known.T_world_base * T_odom_base.inverse();
  known.v_world_m_s = R_world_base * velocity_base_m_s;
  known.v_odom_m_s = T_odom_base.linear() * velocity_base_m_s;
  known_.push_back(known);
  if (known_.size() > kMostKnown) known_.pop_front();
  transform.transform = isometry_to_msg(T_odom_base);
  return restarted ? OdometryTrack::Verdict::kRestarted : OdometryTrack::Verdict::kAdded;
}

const InertialTrack::Known& InertialTrack::known_at(std::int64_t stamp_ns) {
  while (known_.size() > 1 && known_[1].stamp_ns <= stamp_ns) known_.pop_front();
  return known_.front();
}

InertialPlacement placement_of(const InertialTrack::Known& known) {
  constexpr std::array<Eigen::Index, 3> kPlanar = {0, 1, 5};
  InertialPlacement placement;
  placement.T_world_odom = pose2_of(known.T_world_odom);
  for (Eigen::Index i = 0; i < 3; ++i) {
    for (Eigen::Index k = 0; k < 3; ++k) {
      placement.pose_covariance(i, k) =
          known.covariance(kPlanar[static_cast<std::size_t>(i)], kPlanar[static_cast<std::size_t>(k)]);
    }
  }
  placement.v_odom_m_s = known.v_odom_m_s.head<2>();
  placement.v_world_m_s = known.v_world_m_s.head<2>();
  placement.velocity_sigma_m_s = known.velocity_sigma_m_s;
  return placement;
}

}  // namespace situation_awareness

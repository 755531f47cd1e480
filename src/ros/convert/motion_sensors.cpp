// SPDX-License-Identifier: BSD-3-Clause
#include "situation_awareness/ros/convert/motion_sensors.hpp"

#include <array>
#include <cmath>
#include <cstddef>

#include <GeographicLib/LocalCartesian.hpp>

#include "situation_awareness/ros/convert/time.hpp"

namespace situation_awareness {
namespace {

geometry_msgs::Vector3 vector_to_msg(const Eigen::Vector3d& vector) {
  geometry_msgs::Vector3 msg;
  msg.x = vector.x();
  msg.y = vector.y();
  msg.z = vector.z();
  return msg;
}

/// Variance of each axis, of white noise whose density is per root of the band of the samples.
template <class Covariance>
void set_white_noise(double density, double rate_hz, Covariance& covariance) {
  covariance.fill(0.0);
  for (const std::size_t axis : {0, 4, 8}) covariance[axis] = density * density * rate_hz;
}

/// The covariance of x, y and yaw in one of x, y, z, roll, pitch and yaw.
template <class Covariance>
void set_planar(const Eigen::Matrix3d& planar, Covariance& covariance) {
  constexpr std::array<std::size_t, 3> kPlaces = {0, 1, 5};
  covariance.fill(0.0);
  for (const std::size_t axis : {2, 3, 4}) covariance[7 * axis] = kUnmeasuredVariance;
  for (std::size_t row = 0; row < 3; ++row) {
    for (std::size_t column = 0; column < 3; ++column) {
      covariance[6 * kPlaces[row] + kPlaces[column]] =
          planar(static_cast<Eigen::Index>(row), static_cast<Eigen::Index>(column));
    }
  }
}

}  // namespace

sensor_msgs::Imu imu_to_msg(const ImuSample& sample, const SimulatedImuParams& params, const std::string& imu_frame) {
  sensor_msgs::Imu msg;
  msg.header.stamp = to_ros_time(sample.stamp_ns);
  msg.header.frame_id = imu_frame;
  msg.orientation.w = 1.0;
  msg.orientation_covariance.fill(0.0);
  msg.orientation_covariance[0] = -1.0;
  msg.angular_velocity = vector_to_msg(sample.angular_velocity_imu_rad_s);
  msg.linear_acceleration = vector_to_msg(sample.specific_force_imu_m_s2);
  set_white_noise(params.gyroscope_noise, params.rate_hz, msg.angular_velocity_covariance);
  set_white_noise(params.accelerometer_noise, params.rate_hz, msg.linear_acceleration_covariance);
  return msg;
}

sensor_msgs::NavSatFix fix_to_msg(const GnssFix& fix, const WorldOrigin& origin, const std::string& antenna_frame) {
  const GeographicLib::LocalCartesian world(origin.latitude_deg, origin.longitude_deg, origin.altitude_m);
  sensor_msgs::NavSatFix msg;
  msg.header.stamp = to_ros_time(fix.stamp_ns);
  msg.header.frame_id = antenna_frame;
  msg.status.status = sensor_msgs::NavSatStatus::STATUS_FIX;
  msg.status.service = sensor_msgs::NavSatStatus::SERVICE_GPS;
  const Eigen::Vector3d& p_world_m = fix.position_world_m;
  world.Reverse(p_world_m.x(), p_world_m.y(), p_world_m.z(), msg.latitude, msg.longitude, msg.altitude);
  for (std::size_t i = 0; i < 9; ++i) {
    msg.position_covariance[i] = fix.covariance_m2(static_cast<Eigen::Index>(i / 3), static_cast<Eigen::Index>(i % 3));
  }
  msg.position_covariance_type = sensor_msgs::NavSatFix::COVARIANCE_TYPE_KNOWN;
  return msg;
}

nav_msgs::Odometry odometry_to_msg(const OdometrySample& sample, const std::string& odom_frame,
                                   const std::string& base_frame) {
  nav_msgs::Odometry msg;
  msg.header.stamp = to_ros_time(sample.stamp_ns);
  msg.header.frame_id = odom_frame;
  msg.child_frame_id = base_frame;
  msg.pose.pose.position.x = sample.T_odom_base.translation_m.x();
  msg.pose.pose.position.y = sample.T_odom_base.translation_m.y();
  msg.pose.pose.orientation.z = std::sin(0.5 * sample.T_odom_base.yaw_rad);
  msg.pose.pose.orientation.w = std::cos(0.5 * sample.T_odom_base.yaw_rad);
  msg.twist.twist.linear.x = sample.velocity_base_m_s.x();
  msg.twist.twist.linear.y = sample.velocity_base_m_s.y();
  msg.twist.twist.angular.z = sample.yaw_rate_rad_s;
  set_planar(sample.pose_covariance, msg.pose.covariance);
  set_planar(sample.twist_covariance, msg.twist.covariance);
  return msg;
}

}  // namespace situation_awareness

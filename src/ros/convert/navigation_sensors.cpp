// SPDX-License-Identifier: BSD-3-Clause
#include "situation_awareness/ros/convert/navigation_sensors.hpp"

#include "situation_awareness/ros/convert/odometry.hpp"
#include "situation_awareness/ros/convert/poses.hpp"
#include "situation_awareness/ros/convert/time.hpp"

namespace situation_awareness {
namespace {

using Matrix6 = Eigen::Matrix<double, 6, 6>;

void set_covariance(const Matrix6& P, boost::array<double, 36>& msg) {
  Eigen::Map<Eigen::Matrix<double, 6, 6, Eigen::RowMajor>>(msg.data()) = P;
}

}  // namespace

InertialSample inertial_sample_from_msg(const sensor_msgs::Imu& msg) {
  InertialSample sample;
  sample.stamp_ns = to_nanoseconds(msg.header.stamp);
  sample.specific_force_m_s2 << msg.linear_acceleration.x, msg.linear_acceleration.y, msg.linear_acceleration.z;
  sample.angular_velocity_rad_s << msg.angular_velocity.x, msg.angular_velocity.y, msg.angular_velocity.z;
  return sample;
}

GeodeticFix fix_from_msg(const sensor_msgs::NavSatFix& msg) {
  GeodeticFix fix;
  fix.stamp_ns = to_nanoseconds(msg.header.stamp);
  fix.is_fix = msg.status.status >= sensor_msgs::NavSatStatus::STATUS_FIX;
  fix.position = {msg.latitude, msg.longitude, msg.altitude};
  if (msg.position_covariance_type == sensor_msgs::NavSatFix::COVARIANCE_TYPE_UNKNOWN) return fix;
  for (int i = 0; i < 9; ++i) fix.covariance_m2(i / 3, i % 3) = msg.position_covariance[static_cast<std::size_t>(i)];
  return fix;
}

nav_msgs::Odometry odometry_to_msg(const GpsInsPose& pose, const std::string& world_frame,
                                   const std::string& base_frame) {
  nav_msgs::Odometry msg;
  msg.header.stamp = to_ros_time(pose.stamp_ns);
  msg.header.frame_id = world_frame;
  msg.child_frame_id = base_frame;
  msg.pose.pose = pose_of(isometry_to_msg(pose.T_world_base));
  // R exp(delta) = exp(R delta) R.
  Matrix6 J = Matrix6::Identity();
  J.bottomRightCorner<3, 3>() = pose.T_world_base.linear();
  set_covariance(J * pose.covariance * J.transpose(), msg.pose.covariance);
  msg.twist.twist.linear.x = pose.velocity_base_m_s.x();
  msg.twist.twist.linear.y = pose.velocity_base_m_s.y();
  msg.twist.twist.linear.z = pose.velocity_base_m_s.z();
  msg.twist.twist.angular.x = pose.angular_velocity_base_rad_s.x();
  msg.twist.twist.angular.y = pose.angular_velocity_base_rad_s.y();
  msg.twist.twist.angular.z = pose.angular_velocity_base_rad_s.z();
  set_covariance(pose.twist_covariance, msg.twist.covariance);
  return msg;
}

}  // namespace situation_awareness

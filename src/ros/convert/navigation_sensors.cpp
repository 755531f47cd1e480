// SPDX-License-Identifier: BSD-3-Clause
#include "situation_awareness/ros/convert/navigation_sensors.hpp"

#include "situation_awareness/ros/convert/time.hpp"

namespace situation_awareness {

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

}  // namespace situation_awareness

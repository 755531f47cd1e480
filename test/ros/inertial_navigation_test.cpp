// SPDX-License-Identifier: BSD-3-Clause
#include "situation_awareness/ros/inertial_navigation.hpp"

#include <algorithm>
#include <cmath>
#include <cstdint>

#include <gtest/gtest.h>
#include <tf2/buffer_core.h>

#include "pose/gps_ins_flight.hpp"
#include "situation_awareness/pose/inertial_motion.hpp"
#include "situation_awareness/pose/local_world.hpp"

namespace situation_awareness {
namespace {

ros::Time stamp_of(const FlightRun& run) {
  ros::Time stamp;
  stamp.fromNSec(static_cast<std::uint64_t>(1'000'000'000'000 + run.stamp_ns()));
  return stamp;
}

sensor_msgs::Imu imu_of(FlightRun& run) {
  const InertialSample sample = run.sample();
  sensor_msgs::Imu msg;
  msg.header.stamp = stamp_of(run);
  msg.header.frame_id = "base_link";
  msg.orientation_covariance[0] = -1.0;
  msg.linear_acceleration.x = sample.specific_force_m_s2.x();
  msg.linear_acceleration.y = sample.specific_force_m_s2.y();
  msg.linear_acceleration.z = sample.specific_force_m_s2.z();
  msg.angular_velocity.x = sample.angular_velocity_rad_s.x();
  msg.angular_velocity.y = sample.angular_velocity_rad_s.y();
  msg.angular_velocity.z = sample.angular_velocity_rad_s.z();
  return msg;
}

sensor_msgs::NavSatFix fix_of(FlightRun& run, const GeodeticPosition& origin) {
  const GeodeticPosition position = geodetic_position(origin, run.fix());
  sensor_msgs::NavSatFix msg;
  msg.header.stamp = stamp_of(run);
  msg.header.frame_id = "base_link";
  msg.status.status = sensor_msgs::NavSatStatus::STATUS_FIX;
  msg.latitude = position.latitude_deg;
  msg.longitude = position.longitude_deg;
  msg.altitude = position.altitude_m;
  Eigen::Map<Eigen::Matrix3d>(msg.position_covariance.data()) = run.fix_covariance();
  msg.position_covariance_type = sensor_msgs::NavSatFix::COVARIANCE_TYPE_KNOWN;
  return msg;
}

// A flight that begins in a turn: the tilt is not known from gravity then, nor well when the pose is just ready.
TEST(InertialNavigation, ChangesOfTheVelocityAreRightSoonAfterAStartInATurn) {
  const GeodeticPosition origin{47.0, 8.0, 400.0};
  tf2::BufferCore tf;
  SimulatedFlight flight;
  flight.legs = {{14.0, 0.75}, {6.0, 0.0}, {14.0, -0.75}, {20.0, 0.2}};
  for (std::uint64_t seed = 1; seed <= 6; ++seed) {
    FlightRun run(flight, {}, seed);
    double odom_yaw_rad = 0.0;
    InertialNavigation navigation({}, tf,
                                  {[&](const geometry_msgs::TransformStamped& T_odom_base) {
                                     const auto& q = T_odom_base.transform.rotation;
                                     odom_yaw_rad = yaw_of(Eigen::Quaterniond(q.w, q.x, q.y, q.z));
                                   },
                                   [] {}});
    double ready_s = -1.0, most_m_s = 0.0;
    Eigen::Vector2d v_odom_m_s = Eigen::Vector2d::Zero(), v_m_s = Eigen::Vector2d::Zero();
    Eigen::Rotation2Dd R_odom_world(0.0);
    int windows = 0;
    for (; run.time_s() < 60.0; run.next()) {
      navigation.add_imu(imu_of(run));
      if (run.has_fix()) navigation.add_fix(fix_of(run, origin));
      if (!navigation.is_ready()) continue;
      if (ready_s < 0.0) ready_s = run.time_s();
      const long step = std::lround((run.time_s() - ready_s) * 200.0);
      if (step < 1000 || step % 400 != 0) continue;  // from 5 s on, each 2 s
      const auto stamp_ns = static_cast<std::int64_t>(stamp_of(run).toNSec());
      const Eigen::Isometry3d nowhere = Eigen::Isometry3d::Identity();
      const InertialPlacement placement = navigation.placement_at(stamp_ns, nowhere, nowhere);
      const Eigen::Vector2d v_now_m_s = flight.velocity(run.time_s()).head<2>();
      if (windows++ > 0) {
        const Eigen::Vector2d error_m_s = placement.v_odom_m_s - v_odom_m_s - R_odom_world * (v_now_m_s - v_m_s);
        most_m_s = std::max(most_m_s, error_m_s.norm());
      }
      v_odom_m_s = placement.v_odom_m_s;
      v_m_s = v_now_m_s;
      R_odom_world = Eigen::Rotation2Dd(odom_yaw_rad - flight.yaw(run.time_s()));
    }
    EXPECT_GT(windows, 8) << seed;
    EXPECT_LT(most_m_s, 1.3) << seed;  // what the filter's own tilt leaves; 6 m/s with that of the start
  }
}

}  // namespace
}  // namespace situation_awareness

// SPDX-License-Identifier: BSD-3-Clause
// IMU, GNSS and wheel odometry as messages, and as simulate_bag records them.
#include <cmath>
#include <cstdlib>
#include <filesystem>
#include <string>
#include <vector>

#include <gtest/gtest.h>
#include <rosbag/bag.h>
#include <rosbag/view.h>
#include <tf2_msgs/TFMessage.h>

#include "situation_awareness/common/time.hpp"
#include "situation_awareness/geometry/angles.hpp"
#include "situation_awareness/ros/convert/motion_sensors.hpp"
#include "situation_awareness/ros/convert/time.hpp"
#include "situation_awareness/ros/simulation.hpp"
#include "situation_awareness/sim/sensors.hpp"

namespace situation_awareness::motion_sensors_test {
namespace {

const std::string kWorldFile = std::string(SITUATION_AWARENESS_SOURCE_DIR) + "/test/ros/motion.xml";

TEST(ImuMessage, HasTheVarianceOfTheWhiteNoiseAndNoOrientation) {
  ImuSample sample;
  sample.stamp_ns = 1234567890123456789;
  sample.specific_force_imu_m_s2 << 1.0, 2.0, 9.0;
  sample.angular_velocity_imu_rad_s << 0.1, 0.2, 0.3;
  SimulatedImuParams params;
  params.rate_hz = 100.0;
  params.gyroscope_noise = 1e-3;
  params.accelerometer_noise = 0.02;
  const sensor_msgs::Imu msg = imu_to_msg(sample, params, "imu");
  EXPECT_EQ(to_nanoseconds(msg.header.stamp), sample.stamp_ns);
  EXPECT_EQ(msg.header.frame_id, "imu");
  EXPECT_EQ(msg.orientation_covariance[0], -1.0) << "sensor_msgs: not measured";
  EXPECT_EQ(msg.linear_acceleration.x, 1.0);
  EXPECT_EQ(msg.linear_acceleration.y, 2.0);
  EXPECT_EQ(msg.linear_acceleration.z, 9.0);
  EXPECT_EQ(msg.angular_velocity.x, 0.1);
  EXPECT_EQ(msg.angular_velocity.y, 0.2);
  EXPECT_EQ(msg.angular_velocity.z, 0.3);
  for (std::size_t i = 0; i < 9; ++i) {
    EXPECT_DOUBLE_EQ(msg.angular_velocity_covariance[i], i % 4 == 0 ? 1e-4 : 0.0);
    EXPECT_DOUBLE_EQ(msg.linear_acceleration_covariance[i], i % 4 == 0 ? 0.04 : 0.0);
  }
}

TEST(FixMessage, IsWhereTheRadiiOfCurvatureSay) {
  // WGS 84: M and N are the radii of curvature along the meridian and across it.
  constexpr double kA_m = 6378137.0, kFlattening = 1.0 / 298.257223563, kE2 = kFlattening * (2.0 - kFlattening);
  for (const double latitude_deg : {-60.0, 0.0, 47.3769}) {
    const WorldOrigin origin{latitude_deg, 8.5417, 460.0};
    GnssFix fix;
    fix.stamp_ns = 5 * kNanosecondsPerSecond;
    fix.position_world_m << 100.0, -50.0, 3.0;
    fix.covariance_m2 = Eigen::Vector3d(2.0, 3.0, 8.0).asDiagonal();
    const sensor_msgs::NavSatFix msg = fix_to_msg(fix, origin, "antenna");
    const double s = std::sin(radians(latitude_deg));
    const double N_m = kA_m / std::sqrt(1.0 - kE2 * s * s);
    const double M_m = N_m * (1.0 - kE2) / (1.0 - kE2 * s * s);
    const double north_m = radians(msg.latitude - latitude_deg) * (M_m + origin.altitude_m);
    const double east_m =
        radians(msg.longitude - origin.longitude_deg) * (N_m + origin.altitude_m) * std::cos(radians(latitude_deg));
    EXPECT_NEAR(east_m, 100.0, 4e-3) << "to first order: of the second is d^2 / R";
    EXPECT_NEAR(north_m, -50.0, 4e-3);
    EXPECT_NEAR(msg.altitude - origin.altitude_m, 3.0, 2e-3);
    EXPECT_EQ(msg.header.frame_id, "antenna");
    EXPECT_EQ(to_nanoseconds(msg.header.stamp), fix.stamp_ns);
    EXPECT_EQ(msg.status.status, sensor_msgs::NavSatStatus::STATUS_FIX);
    EXPECT_EQ(msg.position_covariance_type, sensor_msgs::NavSatFix::COVARIANCE_TYPE_KNOWN);
    EXPECT_EQ(msg.position_covariance[0], 2.0);
    EXPECT_EQ(msg.position_covariance[4], 3.0);
    EXPECT_EQ(msg.position_covariance[8], 8.0);
    EXPECT_EQ(msg.position_covariance[1], 0.0);
  }
}

TEST(OdometryMessage, HasThePlanarCovarianceInItsPlaces) {
  OdometrySample sample;
  sample.stamp_ns = 1;
  sample.T_odom_base = {{1.0, 2.0}, 2.0};
  sample.velocity_base_m_s << 0.5, 0.1;
  sample.yaw_rate_rad_s = -0.2;
  sample.pose_covariance << 1, 2, 3, 2, 5, 6, 3, 6, 9;
  sample.twist_covariance << 10, 20, 30, 20, 50, 60, 30, 60, 90;
  const nav_msgs::Odometry msg = odometry_to_msg(sample, "odom", "base");
  EXPECT_EQ(msg.header.frame_id, "odom");
  EXPECT_EQ(msg.child_frame_id, "base");
  EXPECT_EQ(msg.pose.pose.position.x, 1.0);
  EXPECT_EQ(msg.pose.pose.position.y, 2.0);
  EXPECT_NEAR(2.0 * std::atan2(msg.pose.pose.orientation.z, msg.pose.pose.orientation.w), 2.0, 1e-15);
  EXPECT_EQ(msg.twist.twist.linear.x, 0.5);
  EXPECT_EQ(msg.twist.twist.linear.y, 0.1);
  EXPECT_EQ(msg.twist.twist.angular.z, -0.2);
  const std::vector<std::size_t> places = {0, 1, 5};  // x, y and yaw of x, y, z, roll, pitch, yaw
  for (std::size_t row = 0; row < 3; ++row) {
    for (std::size_t column = 0; column < 3; ++column) {
      const std::size_t place = 6 * places[row] + places[column];
      const auto r = static_cast<Eigen::Index>(row), c = static_cast<Eigen::Index>(column);
      EXPECT_EQ(msg.pose.covariance[place], sample.pose_covariance(r, c));
      EXPECT_EQ(msg.twist.covariance[place], sample.twist_covariance(r, c));
    }
  }
  for (const std::size_t axis : {2, 3, 4}) EXPECT_EQ(msg.pose.covariance[7 * axis], kUnmeasuredVariance);
}

/// All messages of a topic.
template <class Message>
std::vector<Message> messages_of(const rosbag::Bag& bag, const std::string& topic) {
  std::vector<Message> messages;
  rosbag::View view(bag, rosbag::TopicQuery(topic));
  for (const rosbag::MessageInstance& instance : view) {
    const auto msg = instance.instantiate<Message>();
    EXPECT_TRUE(msg) << topic;
    if (!msg) break;
    EXPECT_EQ(instance.getTime(), msg->header.stamp) << topic;
    messages.push_back(*msg);
  }
  return messages;
}

/// The topic has what a sensor of the core measures in a second.
template <class Message, class Sensor, class ToMsg>
void expect_recorded(const rosbag::Bag& bag, const std::string& topic, Sensor sensor, const ToMsg& to_msg) {
  const std::vector<Message> messages = messages_of<Message>(bag, topic);
  EXPECT_EQ(messages.size(), static_cast<std::size_t>(sensor.params().rate_hz)) << topic;
  for (const Message& msg : messages) {
    auto sample = sensor.next();
    sample.stamp_ns += kSimulationStart_ns;
    EXPECT_EQ(msg, to_msg(sample)) << topic;
  }
}

TEST(SimulateBag, RecordsWhatTheCoresSensorsMeasureAtTheSameSeed) {
  const std::filesystem::path path = std::filesystem::path(testing::TempDir()) / "motion_sensors_test.bag";
  const std::string command = std::string(SIMULATE_BAG) + " --world " + kWorldFile + " --out " + path.string() +
                              " --duration 1 --rate 10 --resolution-deg 1 --seed 7";
  ASSERT_EQ(std::system(command.c_str()), 0) << command;
  const World world(kWorldFile);
  const WorldSensors sensors = sensors_of(world);
  {
    rosbag::Bag bag(path.string());
    for (std::size_t i = 0; i < 2; ++i) {
      const auto& imu = sensors.imus.at(i);
      expect_recorded<sensor_msgs::Imu>(
          bag, i == 0 ? "/imu" : "/second_imu/imu",
          SimulatedImu(world, imu.T_robot_sensor, imu.params, seed_of_sensor(7, imu.name)),
          [&](const ImuSample& sample) { return imu_to_msg(sample, imu.params, imu.name); });
    }
    const auto& gnss = sensors.gnss_receivers.at(0);
    expect_recorded<sensor_msgs::NavSatFix>(
        bag, "/fix", SimulatedGnss(world, gnss.T_robot_sensor, gnss.params, seed_of_sensor(7, "antenna")),
        [&](const GnssFix& fix) { return fix_to_msg(fix, world.origin().value(), "antenna"); });
    const auto& odometry = sensors.odometries.at(0);
    expect_recorded<nav_msgs::Odometry>(
        bag, "/wheel_odometry",
        SimulatedOdometry(world, odometry.T_robot_sensor, odometry.params, seed_of_sensor(7, "base")),
        [](const OdometrySample& sample) { return odometry_to_msg(sample, "odom", "base"); });

    std::vector<std::string> frames;
    rosbag::View view(bag, rosbag::TopicQuery("/tf_static"));
    for (const rosbag::MessageInstance& instance : view) {
      for (const auto& transform : instance.instantiate<tf2_msgs::TFMessage>()->transforms) {
        EXPECT_EQ(transform.header.frame_id, "lidar");
        frames.push_back(transform.child_frame_id);
        if (transform.child_frame_id != "antenna") continue;
        EXPECT_NEAR(transform.transform.translation.x, -0.2, 1e-12);
        EXPECT_NEAR(transform.transform.translation.z, 0.1, 1e-12);
      }
    }
    EXPECT_EQ(frames, (std::vector<std::string>{"imu", "second_imu", "antenna", "base"}));
  }
  std::filesystem::remove(path);
}

}  // namespace
}  // namespace situation_awareness::motion_sensors_test

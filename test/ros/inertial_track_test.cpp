// SPDX-License-Identifier: BSD-3-Clause
#include "situation_awareness/ros/inertial_track.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <cstdint>
#include <functional>
#include <limits>
#include <stdexcept>
#include <vector>

#include "situation_awareness/geometry/angles.hpp"
#include "situation_awareness/ros/convert/odometry.hpp"
#include "situation_awareness/ros/convert/poses.hpp"
#include "situation_awareness/ros/convert/time.hpp"

namespace situation_awareness {
namespace {

using Verdict = OdometryTrack::Verdict;

constexpr double kSpeed_m_s = 5.0, kTurn_rad_s = 0.4, kBank_rad = -0.2;
constexpr std::int64_t kPeriod_ns = 5'000'000;

/// A banked turn on a circle at constant height: what a source without errors says of it.
nav_msgs::Odometry odometry_at(int i) {
  const double yaw_rad = 1e-9 * static_cast<double>(i * kPeriod_ns) * kTurn_rad_s;
  const double radius_m = kSpeed_m_s / kTurn_rad_s;
  Eigen::Isometry3d T = Eigen::Isometry3d::Identity();
  T.translation() << radius_m * std::sin(yaw_rad), -radius_m * std::cos(yaw_rad), 15.0;
  T.linear() =
      (Eigen::AngleAxisd(yaw_rad, Eigen::Vector3d::UnitZ()) * Eigen::AngleAxisd(kBank_rad, Eigen::Vector3d::UnitX()))
          .toRotationMatrix();
  nav_msgs::Odometry msg;
  msg.header.stamp = to_ros_time(1'000'000'000'000 + i * kPeriod_ns);
  msg.header.frame_id = "world";
  msg.child_frame_id = "base";
  const geometry_msgs::Transform transform = isometry_to_msg(T);
  msg.pose.pose.position.x = transform.translation.x;
  msg.pose.pose.position.y = transform.translation.y;
  msg.pose.pose.position.z = transform.translation.z;
  msg.pose.pose.orientation = transform.rotation;
  msg.twist.twist.linear.x = kSpeed_m_s;
  msg.twist.twist.angular.y = kTurn_rad_s * std::sin(kBank_rad);
  msg.twist.twist.angular.z = kTurn_rad_s * std::cos(kBank_rad);
  for (std::size_t k = 0; k < 6; ++k) msg.pose.covariance[7 * k] = 1.0 + static_cast<double>(k);
  msg.pose.covariance[1] = msg.pose.covariance[6] = 0.5;
  msg.twist.covariance[0] = 0.01;
  msg.twist.covariance[7] = 0.04;
  return msg;
}

Verdict add(InertialTrack& track, const nav_msgs::Odometry& msg, geometry_msgs::TransformStamped* transform = nullptr) {
  geometry_msgs::TransformStamped own = transform_from_odometry(msg);
  const Verdict verdict = track.add(msg, own);
  if (transform != nullptr) *transform = own;
  return verdict;
}

TEST(InertialTrack, FollowsATrueSourceOnACircle) {
  InertialTrack track(1.0);
  for (int i = 0; i < 4000; ++i) {  // 20 s, more than one round
    const nav_msgs::Odometry msg = odometry_at(i);
    geometry_msgs::TransformStamped transform;
    ASSERT_EQ(add(track, msg, &transform), Verdict::kAdded);
    const Eigen::Isometry3d T_world_base = isometry_from_msg(transform_from_odometry(msg).transform);
    // Integrated in steps of 5 ms, of which each chord is 2e-7 too long.
    EXPECT_TRUE(isometry_from_msg(transform.transform).isApprox(T_world_base, 1e-4)) << i;
  }
  const InertialTrack::Known& known = track.known_at(1'000'000'000'000 + 3999 * kPeriod_ns + 1);
  EXPECT_EQ(known.stamp_ns, 1'000'000'000'000 + 3999 * kPeriod_ns);
  EXPECT_LT((known.T_world_odom.matrix() - Eigen::Matrix4d::Identity()).norm(), 1e-3);
}

TEST(InertialTrack, DoesNotJumpWhereTheSourceDoes) {
  InertialTrack track(1.0);
  Eigen::Isometry3d before = Eigen::Isometry3d::Identity();
  for (int i = 0; i < 400; ++i) {
    nav_msgs::Odometry msg = odometry_at(i);
    if (i >= 200) msg.pose.pose.position.x += 3.0;  // a fix
    geometry_msgs::TransformStamped transform;
    add(track, msg, &transform);
    const Eigen::Isometry3d T_odom_base = isometry_from_msg(transform.transform);
    if (i > 0) {
      EXPECT_NEAR((before.inverse() * T_odom_base).translation().norm(), 0.025, 1e-4) << i;
    }
    before = T_odom_base;
  }
  EXPECT_LT(track.known_at(1'000'000'000'000 + 199 * kPeriod_ns).T_world_odom.translation().norm(), 1e-3);
  EXPECT_NEAR(track.known_at(1'000'000'000'000 + 399 * kPeriod_ns).T_world_odom.translation().x(), 3.0, 1e-3);
}

TEST(InertialTrack, GivesThePlacementOfTheStampBefore) {
  InertialTrack track(1.0);
  EXPECT_TRUE(track.empty());
  for (int i = 0; i < 10; ++i) add(track, odometry_at(i));
  const InertialTrack::Known known = track.known_at(1'000'000'000'000 + 4 * kPeriod_ns + kPeriod_ns / 2);
  EXPECT_EQ(known.stamp_ns, 1'000'000'000'000 + 4 * kPeriod_ns);
  const InertialPlacement placement = placement_of(known);
  EXPECT_EQ(placement.pose_covariance(0, 0), 1.0);
  EXPECT_EQ(placement.pose_covariance(0, 1), 0.5);
  EXPECT_EQ(placement.pose_covariance(1, 1), 2.0);
  EXPECT_EQ(placement.pose_covariance(2, 2), 6.0);
  EXPECT_NEAR(placement.velocity_sigma_m_s, 0.2, 1e-12);
}

TEST(InertialTrack, RefusesStampsThatGoBackAndBeginsAnewFarBack) {
  InertialTrack track(1.0);
  add(track, odometry_at(1000));
  EXPECT_EQ(add(track, odometry_at(1000)), Verdict::kRefused);
  EXPECT_EQ(add(track, odometry_at(900)), Verdict::kRefused);
  EXPECT_EQ(add(track, odometry_at(0)), Verdict::kRestarted);
  EXPECT_EQ(track.known_at(0).stamp_ns, 1'000'000'000'000);
}

TEST(InertialTrack, RefusesWhatIsNoOdometry) {
  InertialTrack track(1.0);
  const double nan = std::numeric_limits<double>::quiet_NaN();
  const std::vector<std::function<void(nav_msgs::Odometry&)>> faults{
      [&](nav_msgs::Odometry& msg) { msg.pose.covariance[3] = nan; },
      [&](nav_msgs::Odometry& msg) { msg.twist.covariance[3] = nan; },
      [&](nav_msgs::Odometry& msg) { msg.twist.twist.linear.y = nan; },
      [&](nav_msgs::Odometry& msg) { msg.twist.twist.angular.x = nan; },
      [](nav_msgs::Odometry& msg) { msg.pose.covariance[7] = -1.0; },
      [](nav_msgs::Odometry& msg) { msg.pose.covariance[35] = 0.0; },
      [](nav_msgs::Odometry& msg) { msg.twist.covariance[0] = -1.0; },
      [&](nav_msgs::Odometry& msg) { msg.pose.pose.orientation.w = nan; }};
  for (const auto& spoil : faults) {
    nav_msgs::Odometry msg = odometry_at(0);
    spoil(msg);
    EXPECT_THROW(add(track, msg), std::invalid_argument);
    EXPECT_TRUE(track.empty());
  }
  EXPECT_EQ(add(track, odometry_at(0)), Verdict::kAdded);
}

}  // namespace
}  // namespace situation_awareness

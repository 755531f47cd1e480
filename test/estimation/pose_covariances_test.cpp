// SPDX-License-Identifier: BSD-3-Clause
#include "situation_awareness/estimation/pose_covariances.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <limits>

#include <Eigen/Geometry>

namespace situation_awareness::pose_covariances_test {
namespace {

constexpr double kNan = std::numeric_limits<double>::quiet_NaN(), kInf = std::numeric_limits<double>::infinity();
constexpr std::int64_t kSecond_ns = 1'000'000'000;
constexpr std::int64_t kNow_ns = 1000 * kSecond_ns;

BasePose pose_with(const Eigen::Vector3d& variances) {
  BasePose pose;
  pose.covariance_world.diagonal() = variances;
  return pose;
}

TEST(PoseCovariances, HaveNoSourceUntilOneIsExpectedOrSaysSomething) {
  PoseCovariances poses(0.5);
  EXPECT_FALSE(poses.has_source());
  EXPECT_FALSE(poses.at(kNow_ns));
  poses.expect();
  EXPECT_TRUE(poses.has_source());
  EXPECT_FALSE(poses.at(kNow_ns));
  PoseCovariances other(0.5);
  EXPECT_FALSE(other.add(kNow_ns, pose_with({kNan, kNan, kNan})));
  EXPECT_TRUE(other.has_source()) << "also by a message of no use";
}

TEST(PoseCovariances, ServeForTheirTime) {
  PoseCovariances poses(0.5);
  EXPECT_TRUE(poses.add(kNow_ns, pose_with({1e-4, 2e-4, 0.0})));
  for (const double apart_s : {-0.5, -0.1, 0.0, 0.1, 0.5}) {
    ASSERT_TRUE(poses.at(kNow_ns + static_cast<std::int64_t>(apart_s * 1e9)));
  }
  for (const double apart_s : {-3600.0, -0.51, 0.51, 2.0, 3600.0}) {
    EXPECT_FALSE(poses.at(kNow_ns + static_cast<std::int64_t>(apart_s * 1e9)));
  }
  EXPECT_EQ(poses.at(kNow_ns)->covariance_world(1, 1), 2e-4);
  // Of what happens now the message that came last says it, not one that was ahead then.
  EXPECT_TRUE(poses.latest(kNow_ns));
  poses.add(kNow_ns + 2 * kSecond_ns, pose_with({1e-4, 2e-4, 0.0}));
  EXPECT_TRUE(poses.at(kNow_ns));
  EXPECT_FALSE(poses.latest(kNow_ns));
  poses.restart();
  EXPECT_FALSE(poses.at(kNow_ns));
  EXPECT_FALSE(poses.latest(kNow_ns));
  EXPECT_TRUE(poses.has_source());
}

// What is said last of a time counts, and nothing in the place of what cannot be used.
TEST(PoseCovariances, OneThatCannotBeUsedSaysThatThePoseIsNotKnown) {
  for (const Eigen::Vector3d& variances :
       {Eigen::Vector3d(kNan, 1.0, 1.0), Eigen::Vector3d(1.0, kInf, 1.0), Eigen::Vector3d(1.0, 1.0, -1.0),
        Eigen::Vector3d(0.0, 0.0, 0.0), Eigen::Vector3d(1.0, 0.0, 1.0)}) {
    PoseCovariances poses(0.5);
    poses.add(kNow_ns, pose_with({1e-4, 1e-4, 1e-4}));
    EXPECT_FALSE(poses.add(kNow_ns + kSecond_ns / 25, pose_with(variances)));
    EXPECT_FALSE(poses.at(kNow_ns + kSecond_ns / 25));
    EXPECT_FALSE(poses.latest(kNow_ns + kSecond_ns / 25));
    EXPECT_TRUE(poses.has(kNow_ns + kSecond_ns / 25));
    EXPECT_TRUE(poses.add(kNow_ns + 2 * kSecond_ns / 25, pose_with({1e-4, 1e-4, 1e-4})));
    EXPECT_TRUE(poses.at(kNow_ns + 2 * kSecond_ns / 25));
  }
  PoseCovariances poses(0.5);
  poses.add(kNow_ns, pose_with({1e-4, 1e-4, 1e-4}));
  poses.refuse(kNow_ns + kSecond_ns / 10);
  EXPECT_FALSE(poses.at(kNow_ns + kSecond_ns / 10)) << "in another frame";
}

// One stamp that is wrong changes nothing for the others, and the memory is bounded.
TEST(PoseCovariances, KeepTheLatestWhateverStampsComeBetween) {
  for (const double wrong_s : {-3600.0, -5.0, 2.0, 3600.0}) {
    PoseCovariances poses(0.5);
    std::int64_t stamp_ns = kNow_ns;
    for (int i = 0; i < 1000; ++i) {
      stamp_ns += kSecond_ns / 25;
      poses.add(stamp_ns, pose_with({1e-4, 1e-4, 1e-4}));
      if (i % 100 == 50) poses.add(stamp_ns + static_cast<std::int64_t>(wrong_s * 1e9), pose_with({1.0, 1.0, 1.0}));
      ASSERT_TRUE(poses.at(stamp_ns));
      ASSERT_EQ(poses.at(stamp_ns)->covariance_world(0, 0), 1e-4);
    }
    EXPECT_FALSE(poses.has(kNow_ns + kSecond_ns / 25)) << "forgotten";
  }
}

}  // namespace
}  // namespace situation_awareness::pose_covariances_test

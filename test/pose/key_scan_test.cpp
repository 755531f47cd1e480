// SPDX-License-Identifier: BSD-3-Clause
#include "situation_awareness/pose/key_scan.hpp"

#include <gtest/gtest.h>

#include <cmath>

#include <Eigen/LU>

#include "room_drive.hpp"

namespace situation_awareness::key_scan_test {
namespace {

/// A robot that stands at these places, one after the other.
RoomDrive between(const Pose2& first, const Pose2& second) {
  return RoomDrive([first, second](double time_s) { return time_s < 0.5 ? first : second; });
}

Eigen::Vector3d error_of(const ScanMatch& match, const Pose2& first, const Pose2& second) {
  const Pose2 error = inverse(inverse(first) * second) * match.T_key_level;
  return {error.translation_m.x(), error.translation_m.y(), wrap_to_pi(error.yaw_rad)};
}

TEST(KeyScan, PlacesALaterScanWithTheErrorThatItSays) {
  Random random(3);
  double nees = 0.0;
  constexpr int kTrials = 100;
  for (int trial = 0; trial < kTrials; ++trial) {
    const Pose2 first{{random.uniform(-2.0, 2.0), random.uniform(-1.5, 1.5)}, random.uniform(-3.0, 3.0)};
    const Pose2 second =
        first * Pose2{{random.uniform(-0.5, 0.5), random.uniform(-0.5, 0.5)}, random.uniform(-0.4, 0.4)};
    RoomDrive drive = between(first, second);
    KeyScan key;
    key.set(drive.points(0.0, first));
    const Pose2 guess = inverse(first) * second * Pose2{{0.03, -0.02}, 0.02};
    const ScanMatch match = key.match(drive.points(1.0, second), guess);
    ASSERT_TRUE(match.is_valid) << trial;
    const Eigen::Vector3d error = error_of(match, first, second);
    EXPECT_LT(error.head<2>().norm(), 0.01) << trial;
    EXPECT_LT(std::abs(error.z()), 0.005) << trial;
    nees += error.dot(match.information * error) / 3.0 / kTrials;
  }
  EXPECT_GT(nees, 0.3);
  EXPECT_LT(nees, 3.0);
}

TEST(KeyScan, RefusesAnotherRoom) {
  const Pose2 place{{0.5, 0.3}, 0.2};
  RoomDrive drive = between(place, place);
  KeyScan key;
  key.set(drive.points(0.0, place));
  EXPECT_TRUE(key.match(drive.points(1.0, place), Pose2()).is_valid);
  EXPECT_FALSE(key.match(drive.points(1.0, place), Pose2{{1.2, 0.7}, 0.8}).is_valid);
  EXPECT_FALSE(key.match(Points(), Pose2()).is_valid);
  EXPECT_FALSE(KeyScan().match(drive.points(1.0, place), Pose2()).is_valid);
}

}  // namespace
}  // namespace situation_awareness::key_scan_test

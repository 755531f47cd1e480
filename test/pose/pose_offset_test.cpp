// SPDX-License-Identifier: BSD-3-Clause
#include "situation_awareness/pose/pose_offset.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <cstdint>
#include <functional>
#include <utility>
#include <vector>

#include "room_drive.hpp"
#include "situation_awareness/geometry/lie_groups.hpp"

namespace situation_awareness::pose_offset_test {
namespace {

constexpr double kPeriod_s = 0.08;
constexpr double kDrive_s = 40.0;
constexpr double kLag_s = 0.13;

/// The pose that is looked up at a time, for a robot that was there at another one.
using Pose = std::function<Pose2(double)>;

/// The estimate after scans every kPeriod_s, each with the pose that is looked up `used_s` after its stamp.
PoseOffset estimate(RoomDrive& drive, const Pose& pose, double used_s = 0.0, double duration_s = kDrive_s) {
  PoseOffsetEstimator estimator(used_s);
  for (int i = 0; i * kPeriod_s < duration_s; ++i) {
    const double time_s = i * kPeriod_s;
    estimator.add(drive.points(time_s, pose(time_s + used_s)));
  }
  return estimator.estimate();
}

/// Poses that are late by so much, without noise.
Pose late(const RoomDrive& drive, double lag_s) {
  return [&drive, lag_s](double time_s) { return drive.at(time_s - lag_s); };
}

TEST(PoseOffsetEstimator, FindsHowLatePosesAre) {
  for (const double lag_s : {-0.3, -0.13, -0.02, 0.0, 0.02, 0.05, 0.13, 0.3}) {
    for (std::uint64_t seed = 1; seed <= 3; ++seed) {
      RoomDrive drive(RoomDrive::lively, seed);
      const PoseOffset found = estimate(drive, late(drive, lag_s));
      EXPECT_TRUE(found.is_known) << lag_s;
      EXPECT_NEAR(found.offset_s, lag_s, 0.01) << seed;
      EXPECT_LT(found.sigma_s, 0.01) << lag_s;
    }
  }
}

TEST(PoseOffsetEstimator, FindsItIn15sOfTurningToBothSides) {
  for (const double most_rad_s : {0.4, 0.7, 1.2}) {
    for (const double lag_s : {0.0, 0.03, 0.1, 0.2}) {
      RoomDrive drive([most_rad_s](double t_s) {
        return Pose2{{0.8 * std::sin(0.25 * t_s), 0.5 * std::sin(0.4 * t_s)}, most_rad_s / 0.6 * std::sin(0.6 * t_s)};
      });
      const PoseOffset found = estimate(drive, late(drive, lag_s), 0.0, 15.0);
      EXPECT_TRUE(found.is_known) << lag_s << " s at " << most_rad_s << " rad/s";
      EXPECT_NEAR(found.offset_s, lag_s, 0.01) << most_rad_s;
    }
  }
}

TEST(PoseOffsetEstimator, CountsWithTheOffsetInUse) {
  for (const double used_s : {-0.2, 0.1, kLag_s}) {
    RoomDrive drive(RoomDrive::lively);
    const PoseOffset found = estimate(drive, late(drive, kLag_s), used_s);
    EXPECT_TRUE(found.is_known);
    EXPECT_NEAR(found.offset_s, kLag_s, 0.01) << used_s;
    EXPECT_EQ(is_out_of_step(found, used_s), used_s != kLag_s) << used_s;
  }
}

/// Mean of the squared errors over their variances, of 50 drives with poses of independent errors and of odometry that
/// drifts: 1 for honest standard deviations, from 0.65 to 1.43 in 95 % of all cases (chi-square), and less where the
/// least standard deviation is a part of it.
TEST(PoseOffsetStatistics, SaysHowFarItIsOff) {
  constexpr int kDrives = 50;
  for (const double drift : {0.0, 1.0}) {
    double nees = 0.0;
    for (int seed = 1; seed <= kDrives; ++seed) {
      RoomDrive drive(RoomDrive::lively, static_cast<std::uint64_t>(seed));
      Random random(static_cast<std::uint64_t>(seed));
      Pose2 odometry = drive.at(-kLag_s);
      Pose2 before = odometry;
      const PoseOffset found = estimate(drive, [&](double time_s) {
        const Pose2 now = drive.at(time_s - kLag_s);
        if (drift == 0.0) {
          return Pose2{now.translation_m + 0.02 * Eigen::Vector2d(random.normal(), random.normal()),
                       now.yaw_rad + 0.01 * random.normal()};
        }
        // 3 % too far and turned too much, and a random walk.
        Eigen::Vector3d step = 1.03 * log_se2(inverse(before) * now);
        step += Eigen::Vector3d(0.002 * random.normal(), 0.002 * random.normal(), 0.002 * random.normal());
        odometry = odometry * exp_se2(step);
        before = now;
        return odometry;
      });
      EXPECT_TRUE(found.is_known) << seed;
      const double error_s = found.offset_s - kLag_s;
      EXPECT_LT(std::abs(error_s), 0.02) << seed;
      nees += error_s * error_s / (found.sigma_s * found.sigma_s) / kDrives;
    }
    EXPECT_GT(nees, 0.4) << drift;
    EXPECT_LT(nees, 1.43) << drift;
  }
}

TEST(PoseOffsetEstimator, NeedsMotionThatChanges) {
  const Pose2 start{{-2.0, 0.5}, 0.3};
  const std::vector<std::pair<const char*, RoomDrive::Path>> paths = {
      {"standing", [&](double) { return start; }},
      {"at constant velocity",
       [&](double t_s) {
         return start * Pose2{{0.08 * t_s, 0.0}, 0.0};
       }},
      {"turning at a constant rate",
       [&](double t_s) {
         return start * Pose2{{0.0, 0.0}, 0.5 * t_s};
       }},
      {"on a circle", [&](double t_s) {
         return start * exp_se2({0.4 * t_s, 0.0, 0.4 * t_s});
       }}};
  for (const auto& [name, path] : paths) {
    for (const double pose_sigma : {0.0, 1.0}) {
      RoomDrive drive(path);
      const PoseOffset found = estimate(drive, [&](double time_s) {
        const Pose2 now = drive.at(time_s - kLag_s);
        Random& random = drive.random();
        return Pose2{now.translation_m + pose_sigma * 0.002 * Eigen::Vector2d(random.normal(), random.normal()),
                     now.yaw_rad + pose_sigma * 0.001 * random.normal()};
      });
      EXPECT_FALSE(found.is_known) << name << ", " << found.offset_s << " sigma " << found.sigma_s;
      EXPECT_FALSE(is_out_of_step(found, 0.0)) << name;
    }
  }
}

/// Two walls of 2 m that go to and fro before the robot, in step with its own motion.
std::vector<RoomDrive::WallEnds> walls_that_move(double t_s) {
  const double aside_m = 1.2 * std::sin(0.8 * t_s);
  return {{{4.0, -1.0 + aside_m}, {4.0, 1.0 + aside_m}}, {{-1.0 + aside_m, 3.2}, {1.0 + aside_m, 3.2}}};
}

TEST(PoseOffsetEstimator, IsNotFooledByWhatMoves) {
  for (const double lag_s : {0.0, kLag_s}) {
    RoomDrive drive(RoomDrive::lively);
    drive.moving_walls_world = walls_that_move;
    const PoseOffset found = estimate(drive, late(drive, lag_s));
    EXPECT_TRUE(found.is_known);
    EXPECT_NEAR(found.offset_s, lag_s, 0.015);
  }
  RoomDrive standing([](double) { return Pose2{{0.5, 0.0}, 0.3}; });
  standing.moving_walls_world = walls_that_move;
  EXPECT_FALSE(estimate(standing, late(standing, 0.0)).is_known);
}

TEST(PoseOffsetEstimator, JumpsOfThePoseHaveLittleWeight) {
  RoomDrive drive(RoomDrive::lively);
  const PoseOffset found = estimate(drive, [&](double time_s) {
    // Every 5 s, as of a loop closure or of another fix.
    const double jumps = std::floor(time_s / 5.0);
    return Pose2{{0.2 * jumps, -0.1 * jumps}, 0.05 * jumps} * drive.at(time_s - kLag_s);
  });
  EXPECT_TRUE(found.is_known);
  EXPECT_NEAR(found.offset_s, kLag_s, 0.02);
}

TEST(PoseOffsetEstimator, SaysNothingBeyondItsLags) {
  RoomDrive drive(RoomDrive::lively);
  EXPECT_FALSE(estimate(drive, late(drive, PoseOffsetEstimator::kMaxLag_s + 0.2)).is_known);
}

TEST(PoseOffsetEstimator, StartsAnewWhereTimeDoes) {
  RoomDrive drive(RoomDrive::lively);
  PoseOffsetEstimator estimator(0.0);
  const auto add = [&](double time_s, double lag_s) { estimator.add(drive.points(time_s, drive.at(time_s - lag_s))); };
  for (double time_s = 100.0; time_s < 140.0; time_s += kPeriod_s) add(time_s, 0.3);
  EXPECT_NEAR(estimator.estimate().offset_s, 0.3, 0.02);
  add(0.0, kLag_s);
  EXPECT_FALSE(estimator.estimate().is_known);
  for (double time_s = kPeriod_s; time_s < 40.0; time_s += kPeriod_s) add(time_s, kLag_s);
  EXPECT_NEAR(estimator.estimate().offset_s, kLag_s, 0.01);
}

TEST(PoseOffsetEstimator, GapsBetweenScansDoNoHarm) {
  RoomDrive drive(RoomDrive::lively);
  PoseOffsetEstimator estimator(0.0);
  for (double time_s = 0.0; time_s < 100.0; time_s += std::fmod(time_s, 8.0) < 1.0 ? 1.7 : kPeriod_s) {
    estimator.add(drive.points(time_s, drive.at(time_s - kLag_s)));
  }
  EXPECT_NEAR(estimator.estimate().offset_s, kLag_s, 0.01);
}

TEST(PoseOffset, IsOutOfStepBySigmasAndMilliseconds) {
  const auto out_of_step = [](bool is_known, double offset_s, double sigma_s) {
    return is_out_of_step({is_known, offset_s, sigma_s, 10}, 0.1);
  };
  EXPECT_TRUE(out_of_step(true, 0.13, 0.009));
  EXPECT_TRUE(out_of_step(true, 0.07, 0.009));
  EXPECT_FALSE(out_of_step(true, 0.13, 0.011));
  EXPECT_FALSE(out_of_step(true, 0.119, 0.001));
  EXPECT_FALSE(out_of_step(false, 0.13, 0.009));
}

}  // namespace
}  // namespace situation_awareness::pose_offset_test

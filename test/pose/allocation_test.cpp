// SPDX-License-Identifier: BSD-3-Clause
#include <gtest/gtest.h>

#include <cmath>
#include <cstdint>
#include <utility>
#include <vector>

#include "allocations.hpp"
#include "gps_ins_flight.hpp"
#include "pose/reflector_world.hpp"
#include "room_drive.hpp"
#include "situation_awareness/pose/gps_ins.hpp"
#include "situation_awareness/pose/pose_offset.hpp"

namespace situation_awareness::pose_allocation_test {
namespace {

TEST(Allocation, NoneForTheOffsetOfPosesAfterWarmUp) {
  RoomDrive drive(RoomDrive::lively);
  std::vector<Points> scans;
  for (int i = 0; i < 2500; ++i) scans.push_back(drive.points(0.08 * i, drive.at(0.08 * i - 0.13)));
  PoseOffsetEstimator estimator(0.0);
  std::size_t i = 0;
  for (; i < scans.size() / 4; ++i) estimator.add(scans[i]);
  const std::int64_t before = allocations().count;
  for (; i < scans.size(); ++i) estimator.add(scans[i]);
  EXPECT_EQ(allocations().count - before, 0);
  EXPECT_TRUE(estimator.estimate().is_known);
}

// With false sightings, lost beams, loss of the pose and searches in the warm-up and later.
TEST(Allocation, NoneForLocalisationByReflectorsAfterWarmUp) {
  ReflectorMap map;
  for (const Eigen::Vector2d& center : {Eigen::Vector2d(4.0, 1.0), Eigen::Vector2d(-2.5, 3.2),
                                        Eigen::Vector2d(-1.5, -3.0), Eigen::Vector2d(3.0, -2.8)}) {
    map.reflectors.push_back({center, 0.05});
  }
  ReflectorWorld world;
  world.add_room({-5.5, -4.5}, {5.5, 4.5});
  world.add(map);
  world.cylinders.push_back({{2.0, 3.0}, 0.06, 700.0});
  world.angle_min_rad = -kPi;
  world.beams = 720;
  world.lost_share = 0.01;
  world.path = winding_path(0.5);
  Random random(1);
  std::vector<Points> scans;
  for (int i = 0; i < 400; ++i) scans.push_back(world.points(0.1 + 0.04 * i, random));
  DriftingWheels wheels(world.path, 1);
  std::vector<std::pair<std::int64_t, Pose2>> odometry;
  while (wheels.next_time_s() < 17.0) odometry.push_back(wheels.next());

  ReflectorLocalization localization(map, {});
  ReflectorSightings sightings;
  std::size_t next = 0;
  std::int64_t before = 0;
  int known = 0;
  for (std::size_t i = 0; i < scans.size(); ++i) {
    if (i == 100) before = allocations().count;
    if (i % 80 == 60) localization.relocate();
    if (i % 80 == 70) localization.initial_pose(scans[i].stamp_ns, {{3.0, 3.0}, 2.0}, 0.05, 0.05);  // wrong
    while (next < odometry.size() && odometry[next].first < scans[i].stamp_ns + 45'000'000) {
      localization.add_odometry(odometry[next].first, odometry[next].second);
      ++next;
    }
    sightings = detect_reflectors(scans[i], {}, std::move(sightings));
    known += localization.update(sightings, {}).is_known ? 1 : 0;
  }
  EXPECT_EQ(allocations().count - before, 0);
  EXPECT_GT(known, 300);
}

// Fixes that come late, a recovery and a full history in the warm-up and later.
TEST(Allocation, NoneForGpsInsAfterWarmUp) {
  FlightRun run({}, {}, 1);
  GpsIns ins({}, {});
  std::int64_t before = 0;
  std::vector<std::pair<std::int64_t, Eigen::Vector3d>> late;
  late.reserve(1000);
  // Far fixes until 80 s, then right ones again, both refused for 10 s: the yaw is lost and found again.
  for (; run.time_s() < 130.0; run.next()) {
    if (before == 0 && run.time_s() > 50.0) before = allocations().count;
    ins.add_imu(run.sample());
    if (!run.has_fix()) continue;
    late.emplace_back(run.stamp_ns(), run.fix());
    if (late.size() > 2) {
      const auto& [stamp_ns, fix] = late[late.size() - 2];
      const bool is_outlier = run.time_s() < 100.0 && std::fmod(run.time_s(), 40.0) > 28.0;
      ins.add_position(stamp_ns, fix + (is_outlier ? 50.0 : 0.0) * Eigen::Vector3d::UnitX(), run.fix_covariance());
      ins.add_altitude(stamp_ns, 0.0, 1.0);
      ins.add_heading(stamp_ns, 0.0, 3.0);
    }
    ins.pose();
  }
  EXPECT_TRUE(ins.is_ready());
  EXPECT_GT(ins.counters().of("fix outside its gate"), 0u);
  EXPECT_EQ(allocations().count - before, 0);
}

}  // namespace
}  // namespace situation_awareness::pose_allocation_test

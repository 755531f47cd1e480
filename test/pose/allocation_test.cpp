// SPDX-License-Identifier: BSD-3-Clause
#include <gtest/gtest.h>

#include <cstdint>
#include <vector>

#include "allocations.hpp"
#include "room_drive.hpp"
#include "situation_awareness/pose/pose_offset.hpp"

namespace situation_awareness {
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

}  // namespace
}  // namespace situation_awareness

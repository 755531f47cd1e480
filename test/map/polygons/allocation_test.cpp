// SPDX-License-Identifier: BSD-3-Clause
#include "allocations.hpp"

#include <cstdint>
#include <utility>
#include <vector>

#include <gtest/gtest.h>

#include "map/polygons/guarded_map.hpp"
#include "map/polygons/room_polylines.hpp"

namespace situation_awareness::map_polygons_allocation_test {
namespace {

// An update and its chains allocate nothing while the same scans come again.
TEST(Allocation, NoneForTheMapOfPolygonsAfterWarmUp) {
  RoomPolylines room(1);
  for (int i = 0; i < 6; ++i) room.add_box({{-2.0 + 0.8 * i, 1.2}, 0.1 * i, 0.15, 0.1});
  std::vector<Polylines> scans = room.next(100);
  GuardedMap map(PolygonMapParams{});
  const Eigen::Matrix3d covariance = Eigen::Vector3d(1e-6, 1e-6, 1e-7).asDiagonal();
  std::int64_t asked = 0;
  std::int64_t stamp_ns = 1'000'000'000'000;
  for (int round = 0; round < 12; ++round) {
    asked = 0;
    for (Polylines& scan : scans) {
      scan.stamp_ns = stamp_ns += RoomPolylines::kPeriod_ns;
      const std::int64_t before = allocations().count;
      map.update(scan, covariance);
      asked += allocations().count - before;
    }
  }
  EXPECT_GT(map.polygons().chains.size(), 3U);
  EXPECT_EQ(asked, 0);
}

}  // namespace
}  // namespace situation_awareness::map_polygons_allocation_test

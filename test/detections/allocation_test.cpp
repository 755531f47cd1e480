// SPDX-License-Identifier: BSD-3-Clause
#include <gtest/gtest.h>

#include <cmath>
#include <cstddef>
#include <cstdint>
#include <string>
#include <vector>

#include "allocations.hpp"
#include "situation_awareness/detections/shape_network.hpp"
#include "situation_awareness/geometry/angles.hpp"

namespace situation_awareness::detections_allocation_test {
namespace {

/// Faces square on, of 5 to 24 hits, each at another distance.
Segments faces(std::size_t count) {
  Segments scan;
  scan.resolution_rad = radians(0.5);
  for (std::size_t i = 0; i < count; ++i) {
    Segment segment;
    segment.first = scan.points.size();
    segment.count = 5 + i % 20;
    for (std::size_t k = 0; k < segment.count; ++k) {
      Point point;
      point.azimuth_rad = static_cast<double>(k) * scan.resolution_rad;
      point.range_m = (1.0 + 0.1 * static_cast<double>(i)) / std::cos(point.azimuth_rad);
      point.p_level_m = point.range_m * Eigen::Vector2d(std::cos(point.azimuth_rad), std::sin(point.azimuth_rad));
      scan.points.push_back(point);
    }
    scan.segments.push_back(segment);
  }
  return scan;
}

TEST(Allocation, NoneForShapesAfterWarmUp) {
  constexpr std::size_t kMost = 40;
  ShapeNetwork network(SITUATION_AWARENESS_SOURCE_DIR "/models/shape.onnx");
  const Segments scan = faces(kMost);
  std::vector<std::size_t> which(kMost);
  for (std::size_t i = 0; i < kMost; ++i) which[i] = i;
  network.infer(scan, which, 0.01, 0.5);
  const std::int64_t before = allocations().count;
  std::size_t estimates = 0;
  while (!which.empty()) {
    estimates += network.infer(scan, which, 0.01, 0.5).size();
    which.pop_back();
  }
  EXPECT_EQ(allocations().count - before, 0);
  EXPECT_EQ(estimates, kMost * (kMost + 1) / 2);
}

}  // namespace
}  // namespace situation_awareness::detections_allocation_test

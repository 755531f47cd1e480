// SPDX-License-Identifier: BSD-3-Clause
#include "situation_awareness/map/free_space_memory.hpp"

#include <cmath>
#include <cstdint>
#include <vector>

#include <gtest/gtest.h>

#include "situation_awareness/geometry/angles.hpp"

namespace situation_awareness::free_space_memory_test {
namespace {

constexpr std::int64_t kSecond_ns = 1'000'000'000;

/// Of a scanner that sees a wall at `wall_m` all around, or over the front half circle alone.
FreeSpace free_up_to(double wall_m, bool all_around = true) {
  FreeSpace free_space;
  const double half_rad = all_around ? kPi : 0.5 * kPi;
  constexpr int kBeams = 721;
  for (int i = 0; i < kBeams; ++i) {
    free_space.azimuth_rad.push_back(static_cast<float>(-half_rad + 2.0 * half_rad * i / kBeams));
    free_space.range_m.push_back(static_cast<float>(wall_m));
  }
  free_space.full_circle = all_around;
  return free_space;
}

/// On a circle.
std::vector<Eigen::Vector2d> thing_at(const Eigen::Vector2d& p_m, double radius_m = 0.3) {
  std::vector<Eigen::Vector2d> places_m;
  for (int i = 0; i < 8; ++i) {
    places_m.emplace_back(p_m + radius_m * Eigen::Vector2d(std::cos(0.785 * i), std::sin(0.785 * i)));
  }
  return places_m;
}

TEST(FreeSpaceMemory, KnowsTheLatestScanThatPassedAPlaceWhereverTheScannerWas) {
  for (const double yaw_rad : {0.0, 1.3, 3.1, -3.1}) {
    FreeSpaceMemory memory;
    for (int i = 0; i < 10; ++i) {
      memory.add(i * kSecond_ns, {{1.0 * i, 0.0}, yaw_rad}, free_up_to(i < 5 ? 20.0 : 2.0));
    }
    EXPECT_EQ(memory.last_free_ns(thing_at({0.0, 6.0}), 9 * kSecond_ns), 4 * kSecond_ns);
    EXPECT_EQ(memory.last_free_ns(thing_at({0.0, 6.0}), 3 * kSecond_ns), 2 * kSecond_ns);
    EXPECT_EQ(memory.last_free_ns(thing_at({9.0, 1.0}), 20 * kSecond_ns), 9 * kSecond_ns);
    EXPECT_FALSE(memory.last_free_ns(thing_at({0.0, 30.0}), 9 * kSecond_ns));
    EXPECT_FALSE(memory.last_free_ns({}, 9 * kSecond_ns)) << "nowhere";
    EXPECT_EQ(memory.first_free_ns(thing_at({0.0, 6.0}), 1 * kSecond_ns), 2 * kSecond_ns);
    EXPECT_FALSE(memory.first_free_ns(thing_at({0.0, 6.0}), 4 * kSecond_ns));
    EXPECT_EQ(memory.first_free_ns(thing_at({9.0, 1.0}), 5 * kSecond_ns), 8 * kSecond_ns);
    EXPECT_FALSE(memory.first_free_ns({}, -kSecond_ns)) << "nowhere";
  }
}

TEST(FreeSpaceMemory, ABeamThatEndsAtAPlaceOrBeforeItSaysNothing) {
  FreeSpaceMemory memory;
  memory.add(0, {}, free_up_to(5.0, false));
  EXPECT_TRUE(memory.last_free_ns({{4.8, 0.0}}, kSecond_ns));
  EXPECT_FALSE(memory.last_free_ns({{4.9, 0.0}}, kSecond_ns)) << "within the margin";
  EXPECT_FALSE(memory.last_free_ns({{6.0, 0.0}}, kSecond_ns));
  EXPECT_FALSE(memory.last_free_ns({{-1.0, 0.0}}, kSecond_ns)) << "out of the field of view";
  EXPECT_TRUE(memory.last_free_ns({{4.0, 0.0}, {6.0, 0.0}}, kSecond_ns)) << "half of it";
  EXPECT_FALSE(memory.last_free_ns({{4.0, 0.0}, {6.0, 0.0}, {7.0, 0.0}}, kSecond_ns));
  memory.clear();
  EXPECT_FALSE(memory.last_free_ns({{4.0, 0.0}}, kSecond_ns));

  // A post of 1 cm at 3 m: what is 10 cm beside its beam may be it, what is 25 cm beside it is not.
  FreeSpace with_post = free_up_to(5.0);
  with_post.range_m[360] = 3.0F;
  memory.add(0, {}, with_post);
  EXPECT_FALSE(memory.last_free_ns({{4.0, 0.1}}, kSecond_ns));
  EXPECT_TRUE(memory.last_free_ns({{4.0, 0.25}}, kSecond_ns));
  EXPECT_TRUE(memory.last_free_ns({{4.0, -0.25}}, kSecond_ns));
  EXPECT_TRUE(memory.last_free_ns({{-4.0, 1e-9}, {-4.0, -1e-9}}, kSecond_ns)) << "where the first beam meets the last";
}

TEST(FreeSpaceMemory, ForgetsTheOldest) {
  FreeSpaceMemory memory;
  const auto step_ns = static_cast<std::int64_t>(FreeSpaceMemory::kStep_s * 1e9);
  const auto scans = static_cast<std::int64_t>(FreeSpaceMemory::kScans);
  memory.add(0, {}, free_up_to(20.0));
  for (std::int64_t i = 1; i < scans; ++i) {
    memory.add(i * step_ns, {}, free_up_to(2.0));
    memory.add(i * step_ns + 1000, {}, free_up_to(30.0));  // one in kStep_s
  }
  EXPECT_EQ(memory.last_free_ns(thing_at({6.0, 0.0}), scans * step_ns), 0);
  memory.add(scans * step_ns, {}, free_up_to(2.0));
  EXPECT_FALSE(memory.last_free_ns(thing_at({6.0, 0.0}), 2 * scans * step_ns));
}

}  // namespace
}  // namespace situation_awareness::free_space_memory_test

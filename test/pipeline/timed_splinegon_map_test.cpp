// SPDX-License-Identifier: BSD-3-Clause
#include "situation_awareness/pipeline/timed_splinegon_map.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <cstdint>
#include <stdexcept>

#include "situation_awareness/geometry/angles.hpp"

namespace situation_awareness::timed_splinegon_map_test {
namespace {

using Verdict = StampOrder::Verdict;

constexpr double kTower_m = 6.0;      ///< radius of a round tower at the origin
constexpr double kDistance_m = 14.0;  ///< from its middle
constexpr std::int64_t kPeriod_ns = 100'000'000;
constexpr std::int64_t kBegin_ns = 1'000'000'000'000;
/// Scans of a round at 5 m/s.
const int kRound = static_cast<int>(2.0 * kPi * kDistance_m / 0.5) + 1;

SplinegonPipelineParams coarse() {
  SplinegonPipelineParams params;
  params.polylines.max_offset_m = 0.1;
  params.polygons.spacing_m = 0.15;
  params.polygons.gate_m = 0.3;
  params.polygons.max_gap_m = 1.0;
  params.polygons.pass_margin_m = 0.2;
  params.polygons.max_pose_sigma_m = 10.0;
  return params;
}

Eigen::Isometry3d pose_at(int i) {
  const double angle_rad = 0.5 * i / kDistance_m;
  Eigen::Isometry3d T = Eigen::Isometry3d::Identity();
  T.translation() << kDistance_m * std::cos(angle_rad), kDistance_m * std::sin(angle_rad), 10.0;
  T.linear() = Eigen::AngleAxisd(angle_rad + 0.5 * kPi, Eigen::Vector3d::UnitZ()).toRotationMatrix();
  return T;
}

Scan scan_at(int i, std::int64_t stamp_ns) {
  constexpr int kBeams = 721;
  const Eigen::Isometry3d T = pose_at(i);
  const Eigen::Vector2d p_m = T.translation().head<2>();
  Scan scan;
  scan.stamp_ns = stamp_ns;
  scan.angle_min_rad = -kPi;
  scan.angle_increment_rad = 2.0 * kPi / (kBeams - 1);
  for (int k = 0; k < kBeams; ++k) {
    const double angle_rad = scan.angle_min_rad + k * scan.angle_increment_rad;
    const Eigen::Vector2d u = (T.linear() * Eigen::Vector3d(std::cos(angle_rad), std::sin(angle_rad), 0.0)).head<2>();
    const double along_m = -p_m.dot(u), aside_2 = p_m.squaredNorm() - along_m * along_m;
    const bool hits = along_m > 0.0 && aside_2 < kTower_m * kTower_m;
    const double range_m = hits ? along_m - std::sqrt(kTower_m * kTower_m - aside_2) : INFINITY;
    scan.beams.push_back(beam_from_range(static_cast<float>(range_m), 0.1F, 30.0F));
  }
  return scan;
}

Verdict add(TimedSplinegonMap& map, int i, std::int64_t stamp_ns) {
  return map.process(scan_at(i, stamp_ns), pose_at(i), pose_at(i), Eigen::Vector3d(1e-4, 1e-4, 1e-6).asDiagonal());
}

void fly(TimedSplinegonMap& map, int from, int scans, std::int64_t begin_ns = kBegin_ns) {
  for (int i = from; i < from + scans; ++i) ASSERT_EQ(add(map, i, begin_ns + i * kPeriod_ns), Verdict::kNext) << i;
}

void expect_the_tower(const Splinegons& splinegons) {
  ASSERT_EQ(splinegons.boundaries.size(), 1U);
  EXPECT_TRUE(splinegons.boundaries[0].closed);
  for (const SplinegonPoint& point : sampled(splinegons.boundaries[0], 0.1)) {
    EXPECT_NEAR(point.p_world_m.norm(), kTower_m, 0.02);
  }
}

TEST(TimedSplinegonMap, MapsATower) {
  TimedSplinegonMap map(coarse(), 1.0);
  EXPECT_EQ(map.stamp_ns(), TimedSplinegonMap::kNoStamp);
  fly(map, 0, kRound + 30);
  expect_the_tower(map.splinegons());
  EXPECT_EQ(map.splinegons().height_world_m, 10.0);
  EXPECT_EQ(map.stamp_ns(), kBegin_ns + (kRound + 29) * kPeriod_ns);
  const Splinegons later = map.at(map.stamp_ns() + 5);
  EXPECT_EQ(later.stamp_ns, map.stamp_ns() + 5);
  EXPECT_EQ(later.boundaries.size(), 1U);
}

TEST(TimedSplinegonMap, GoesOnWithLoadedBoundaries) {
  TimedSplinegonMap before(coarse(), 1.0);
  fly(before, 0, kRound + 30);
  const SplinegonMapSnapshot saved = before.snapshot();
  // In another program, whose clock may begin anew, stand still, or be ahead.
  for (const std::int64_t later_ns : {-kBegin_ns / 2, std::int64_t{0}, kBegin_ns}) {
    TimedSplinegonMap after(coarse(), 1.0);
    after.resume(saved);
    expect_the_tower(after.splinegons());
    EXPECT_EQ(after.splinegons().boundaries[0].id, saved.elements[0].id);
    fly(after, 0, 40, kBegin_ns + later_ns);
    expect_the_tower(after.splinegons());
    EXPECT_EQ(after.splinegons().boundaries[0].id, saved.elements[0].id) << "it is the same tower";
  }
}

TEST(TimedSplinegonMap, LoadedBoundariesReplaceItsOwn) {
  TimedSplinegonMap map(coarse(), 1.0);
  fly(map, 0, 60);
  const std::int64_t stamp_ns = map.stamp_ns();
  SplinegonMapSnapshot nothing;
  nothing.stamp_ns = 2 * kBegin_ns;
  map.resume(nothing);
  EXPECT_EQ(map.size(), 0U);
  EXPECT_EQ(map.stamp_ns(), stamp_ns);
  fly(map, 60, 60);
  EXPECT_EQ(map.size(), 1U);
}

TEST(TimedSplinegonMap, ResetForgetsAllButTheIds) {
  TimedSplinegonMap map(coarse(), 1.0);
  fly(map, 0, 60);
  ASSERT_EQ(map.size(), 1U);
  const std::uint64_t id = map.splinegons().boundaries[0].id;
  map.reset();
  EXPECT_EQ(map.size(), 0U);
  EXPECT_EQ(map.stamp_ns(), TimedSplinegonMap::kNoStamp);
  fly(map, 0, 60);
  ASSERT_EQ(map.size(), 1U);
  EXPECT_GT(map.splinegons().boundaries[0].id, id);
}

TEST(TimedSplinegonMap, StampsThatGoBackAreRefusedOrARestart) {
  TimedSplinegonMap map(coarse(), 1.0);
  fly(map, 0, 60);
  const std::uint64_t id = map.splinegons().boundaries[0].id;
  const std::int64_t stamp_ns = map.stamp_ns();
  EXPECT_EQ(add(map, 60, stamp_ns), Verdict::kRefused);
  EXPECT_EQ(add(map, 60, stamp_ns - 500'000'000), Verdict::kRefused);
  EXPECT_EQ(map.stamp_ns(), stamp_ns);
  EXPECT_EQ(map.size(), 1U);
  const std::int64_t other_ns = stamp_ns - 100'000'000'000;
  EXPECT_EQ(add(map, 60, other_ns), Verdict::kRefused);
  EXPECT_EQ(add(map, 61, other_ns + kPeriod_ns), Verdict::kRefused);
  EXPECT_EQ(map.size(), 1U) << "a jump is one that three agree with";
  EXPECT_EQ(add(map, 62, other_ns + 2 * kPeriod_ns), Verdict::kRestart);
  EXPECT_EQ(map.size(), 0U);
  fly(map, 63, 60, other_ns - 60 * kPeriod_ns);
  ASSERT_EQ(map.size(), 1U);
  EXPECT_GT(map.splinegons().boundaries[0].id, id);
}

TEST(TimedSplinegonMap, AScanThatCannotBeUsedLeavesItAsItWas) {
  TimedSplinegonMap map(coarse(), 1.0);
  fly(map, 0, 60);
  const std::int64_t stamp_ns = map.stamp_ns();
  Scan scan = scan_at(60, stamp_ns + kPeriod_ns);
  scan.angle_increment_rad = std::nan("");
  EXPECT_THROW(map.process(scan, pose_at(60), pose_at(60), Eigen::Matrix3d(Eigen::Matrix3d::Identity())),
               std::invalid_argument);
  EXPECT_EQ(map.stamp_ns(), stamp_ns);
  EXPECT_EQ(add(map, 60, stamp_ns + kPeriod_ns), Verdict::kNext);
}

}  // namespace
}  // namespace situation_awareness::timed_splinegon_map_test

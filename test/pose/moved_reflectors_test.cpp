// SPDX-License-Identifier: BSD-3-Clause
// Reflectors that do not stand where the map says any more, and what stands there instead.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <cstdio>

#include "pose/reflector_drive.hpp"
#include "situation_awareness/pose/reflector_localization.hpp"
#include "support/numerical_jacobian.hpp"

namespace situation_awareness::moved_reflectors_test {
namespace {

const Eigen::Vector2d kAway_m(0.24, 0.18);

ReflectorWorld driven_room(const ReflectorMap& map) {
  ReflectorWorld world = room_with(map);
  world.path = winding_path(0.5);
  return world;
}

void take_away(Drive& drive, std::size_t reflector) {
  drive.world.cylinders[reflector].center_m += Eigen::Vector2d(500.0, 0.0);
}

const MovedReflector* moved_of(const ReflectorUpdate& update, int reflector) {
  const auto found = std::find_if(update.moved.begin(), update.moved.end(),
                                  [reflector](const MovedReflector& m) { return m.reflector == reflector; });
  return found == update.moved.end() ? nullptr : &*found;
}

bool is_used(const ReflectorUpdate& update, int reflector) {
  const MovedReflector* moved = moved_of(update, reflector);
  return moved != nullptr && moved->is_used;
}

TEST(MovedReflectors, JacobianByThePlaceEqualsTheNumericalOne) {
  Random random(1);
  for (int i = 0; i < 100; ++i) {
    const Pose2 T{{random.uniform(-3.0, 3.0), random.uniform(-3.0, 3.0)}, random.uniform(-kPi, kPi)};
    const Pose2 T_base_lidar{{0.2, -0.1}, random.uniform(-kPi, kPi)};
    const Eigen::Vector2d l = T * (T_base_lidar * Eigen::Vector2d(random.uniform(0.5, 5.0), random.uniform(-3.0, 3.0)));
    const auto H_l =
        numerical_jacobian<2, 2>([&](const Eigen::Vector2d& at) { return observed_reflector(T, T_base_lidar, at); }, l);
    const auto H = observed_reflector_jacobian(T, T_base_lidar, l);
    EXPECT_LT((H_l - observed_reflector_place_jacobian(H, T)).cwiseAbs().maxCoeff(), 1e-7);
  }
}

struct Figures {
  double position_rms_m = 0.0, yaw_rms_rad = 0.0, nees = 0.0, place_error_m = 0.0;
  int used = 0;
};

/// Of three reflectors one is moved and one taken away after 4 s, which leaves one in its place: over seeds, of the
/// last 20 s of 50.
Figures with_one_moved_and_one_gone(double moved_use_s) {
  constexpr int kSeeds = 30;
  Figures result;
  int n = 0;
  for (std::uint64_t seed = 0; seed < kSeeds; ++seed) {
    Random random(9000 + seed);
    const ReflectorMap map = map_of(4, &random);
    ReflectorLocalizationParams params;
    params.moved_use_s = moved_use_s;
    Drive drive(map, driven_room(map), 300 + seed, params);
    drive.guess();
    for (int scan = 0; scan < 1250; ++scan) {
      if (scan == 100) {
        drive.world.cylinders[1].center_m += kAway_m;
        take_away(drive, 3);
      }
      const ReflectorUpdate& update = drive.scan();
      EXPECT_TRUE(update.is_known);
      EXPECT_FALSE(update.is_contradicted && scan > 150);
      if (scan < 750) continue;
      if (scan == 750) take_away(drive, 2);
      const Eigen::Vector3d error = drive.error();
      result.position_rms_m += error.head<2>().squaredNorm();
      result.yaw_rms_rad += error(2) * error(2);
      result.nees += drive.squared_error();
      ++n;
      if (scan < 1249) continue;
      const MovedReflector* moved = moved_of(update, 1);
      EXPECT_NE(moved, nullptr) << seed;
      if (moved == nullptr) continue;
      result.used += moved->is_used ? 1 : 0;
      result.place_error_m =
          std::max(result.place_error_m, (moved->center_world_m - drive.world.cylinders[1].center_m).norm());
    }
  }
  result.position_rms_m = std::sqrt(result.position_rms_m / n);
  result.yaw_rms_rad = std::sqrt(result.yaw_rms_rad / n);
  result.nees /= n;
  std::printf(
      "one moved, two gone, used after %.0f s: RMS %.2f mm, %.2f mrad, NEES %.2f, %d used, place within %.1f mm\n",
      moved_use_s, 1e3 * result.position_rms_m, 1e3 * result.yaw_rms_rad, result.nees, result.used,
      1e3 * result.place_error_m);
  return result;
}

TEST(MovedReflectorsStatistics, AreUsedWhereTheyStandNowWithAnHonestCovariance) {
  const Figures used = with_one_moved_and_one_gone(10.0);
  EXPECT_EQ(used.used, 30);
  EXPECT_LT(used.place_error_m, 0.02);
  EXPECT_GT(used.nees, 2.0);
  EXPECT_LT(used.nees, 4.0);
  const Figures unused = with_one_moved_and_one_gone(1e6);
  EXPECT_EQ(unused.used, 0);
  EXPECT_GT(unused.nees, 2.0);
  EXPECT_LT(unused.nees, 4.0);
  EXPECT_LT(used.yaw_rms_rad, 0.5 * unused.yaw_rms_rad);
  EXPECT_LT(used.position_rms_m, 0.5 * unused.position_rms_m);
}

// What the place says of itself may not become better than the poses by which it was seen.
TEST(MovedReflectorsStatistics, TheirPlaceIsNotKnownBetterThanThePoseSays) {
  ChiSquareSum sum;
  for (std::uint64_t seed = 0; seed < 20; ++seed) {
    Random random(500 + seed);
    const ReflectorMap map = map_of(3, &random);
    Drive drive(map, driven_room(map), 800 + seed);
    drive.guess();
    for (int scan = 0; scan < 700; ++scan) {
      if (scan == 50) drive.world.cylinders[1].center_m += kAway_m;
      const ReflectorUpdate& update = drive.scan();
      if (scan < 699) continue;
      const MovedReflector* moved = moved_of(update, 1);
      ASSERT_TRUE(moved != nullptr && moved->is_used) << seed;
      const Eigen::Vector2d error_m = moved->center_world_m - drive.world.cylinders[1].center_m;
      sum.add(error_m.dot(moved->covariance_m2.inverse() * error_m), 2);
    }
  }
  EXPECT_TRUE(sum.is_consistent());
}

TEST(MovedReflectors, AreGivenUpWhenTheyGoAndUsedAnewElsewhere) {
  const ReflectorMap map = map_of(5);
  Drive drive(map, driven_room(map), 6);
  drive.guess();
  const auto drive_on = [&](int scans) {
    for (int scan = 0; scan < scans; ++scan) drive.scan();
    return drive.scan();
  };
  drive_on(50);
  drive.world.cylinders[3].center_m += kAway_m;
  EXPECT_TRUE(is_used(drive_on(450), 3));
  EXPECT_EQ(drive.scan().matches.size(), 5U);
  drive.world.cylinders[3].center_m -= 2.0 * kAway_m;
  EXPECT_FALSE(is_used(drive_on(100), 3));
  EXPECT_EQ(drive.localization.counters().of("moved reflector gone"), 1U);
  EXPECT_TRUE(is_used(drive_on(500), 3));
  drive.world.cylinders[3].center_m += kAway_m;  // back in its place
  EXPECT_TRUE(drive_on(150).moved.empty());
  EXPECT_EQ(drive.scan().matches.size(), 5U);
  EXPECT_LT(drive.error().head<2>().norm(), 0.01);
}

// A reflector is gone. Someone in bright trousers stands near its place for some seconds, again and again, and walks
// about; a glossy pillar, which is too thick, stands near the place of another that is gone.
TEST(MovedReflectorsStatistics, APersonAndAPillarAreNone) {
  for (std::uint64_t seed = 0; seed < 8; ++seed) {
    const ReflectorMap map = map_of(5);
    ReflectorWorld world = driven_room(map);
    world.cylinders.push_back({{0.0, 0.0}, 0.06, 600.0});                                  // a leg
    world.cylinders.push_back({map.reflectors[3].center_world_m + kAway_m, 0.14, 500.0});  // the pillar
    Drive drive(map, world, 40 + seed);
    drive.guess();
    for (int scan = 0; scan < 50; ++scan) drive.scan();
    take_away(drive, 1);
    take_away(drive, 3);
    double worst_m = 0.0;
    for (int scan = 0; scan < 1500; ++scan) {
      // Stands for 5 s, walks away for 1 s and back for another.
      const double phase_s = std::fmod(0.04 * scan, 7.0);
      const double off_m = std::max(0.0, 1.0 - std::abs(phase_s - 6.0));
      drive.world.cylinders[5].center_m = map.reflectors[1].center_world_m + Eigen::Vector2d(0.3 + off_m, -0.2);
      const ReflectorUpdate& update = drive.scan();
      ASSERT_TRUE(update.is_known);
      for (const MovedReflector& moved : update.moved) ASSERT_FALSE(moved.is_used) << seed << " " << moved.reflector;
      worst_m = std::max(worst_m, drive.error().head<2>().norm());
    }
    EXPECT_EQ(drive.localization.counters().of("moved reflector used"), 0U);
    EXPECT_LT(worst_m, 0.02);
  }
}

}  // namespace
}  // namespace situation_awareness::moved_reflectors_test

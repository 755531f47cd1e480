// SPDX-License-Identifier: BSD-3-Clause
#include "situation_awareness/registration/map_place.hpp"

#include <gtest/gtest.h>

#include <cmath>

#include <Eigen/LU>

#include "situation_awareness/common/random.hpp"
#include "situation_awareness/common/time.hpp"
#include "situation_awareness/geometry/angles.hpp"

namespace situation_awareness::map_place_test {
namespace {

constexpr double kSlow_m = 1.4, kWhite_m = 0.54, kPeriod_s = 0.2;

Eigen::Vector2d normals(Random& random, double sigma) {
  Eigen::Vector2d values;
  for (double& value : values) value = sigma * random.normal();
  return values;
}

struct Result {
  Eigen::Vector3d error;  ///< of the middle of the way, x, y (m) and yaw (rad)
  double nees, mean_fix_error_m;
};

/// Two laps of 20 s on a circle of 15 m, with a Gauss-Markov error of the fixes; the pose at the begin is off.
Result fly(std::uint64_t seed, double slow_s) {
  Random random(seed);
  const Pose2 T_world_map = {Eigen::Vector2d(20.0, -35.0), 2.0};
  const Eigen::Vector2d middle_map_m(3.0, 4.0);
  const Pose2 begin = {T_world_map.translation_m + normals(random, 1.5), T_world_map.yaw_rad + 0.1 * random.normal()};
  MapPlace place;
  place.begin(middle_map_m, begin, 25.0, 0.01);
  Eigen::Vector2d slow_m = normals(random, kSlow_m), sum_m = Eigen::Vector2d::Zero();
  const double kept = std::exp(-kPeriod_s / slow_s), step_m = kSlow_m * std::sqrt(1.0 - kept * kept);
  int count = 0;
  for (double t_s = 0.0; t_s < 40.0; t_s += kPeriod_s, ++count) {
    const double angle = 2.0 * kPi * t_s / 20.0;
    PlacedFix fix;
    fix.stamp_ns = 1 + nanoseconds(t_s);
    fix.antenna_m = middle_map_m + 15.0 * Eigen::Vector2d(std::cos(angle), std::sin(angle));
    const Eigen::Vector2d error_m = slow_m + normals(random, kWhite_m);
    fix.fix_world_m = T_world_map * fix.antenna_m + error_m;
    fix.variance_m2.setConstant(kSlow_m * kSlow_m + kWhite_m * kWhite_m);
    EXPECT_TRUE(place.add(fix, 1e-4)) << t_s;
    slow_m = kept * slow_m + normals(random, step_m);
    sum_m += error_m;
  }
  Result result;
  result.error << place.T_world_map() * middle_map_m - T_world_map * middle_map_m,
      wrap_to_pi(place.T_world_map().yaw_rad - T_world_map.yaw_rad);
  result.nees = result.error.dot(place.covariance_at(middle_map_m).inverse() * result.error);
  result.mean_fix_error_m = sum_m.norm() / count;
  return result;
}

// Of three degrees of freedom; the mean of 200 has a standard deviation of 0.17. How the noise is correlated is learned
// from few independent errors, and filters of the bank are none of these.
TEST(MapPlaceStatistics, KnowsHowWellItIsKnown) {
  for (const double slow_s : {5.0, 30.0}) {
    double nees = 0.0, yaw2 = 0.0, place2 = 0.0, mean2 = 0.0;
    constexpr int kSeeds = 200;
    for (std::uint64_t seed = 1; seed <= kSeeds; ++seed) {
      const Result result = fly(seed, slow_s);
      nees += result.nees / kSeeds;
      yaw2 += result.error.z() * result.error.z() / kSeeds;
      place2 += result.error.head<2>().squaredNorm() / kSeeds;
      mean2 += result.mean_fix_error_m * result.mean_fix_error_m / kSeeds;
    }
    EXPECT_GT(nees, 1.8) << slow_s;
    EXPECT_LT(nees, 4.2) << slow_s;
    EXPECT_LT(std::sqrt(yaw2), radians(1.5)) << slow_s;
    EXPECT_LT(std::sqrt(place2), 1.05 * std::sqrt(mean2)) << slow_s;
  }
}

TEST(MapPlace, IsMovedWithTheWorldAndTheMap) {
  const Pose2 world = {Eigen::Vector2d(5.0, -7.0), 1.0}, map = {Eigen::Vector2d(-2.0, 3.0), -2.5};
  Random random(1);
  MapPlace place, moved;
  const Pose2 T_world_map = {Eigen::Vector2d(1.0, 2.0), 0.5};
  place.begin({3.0, 4.0}, T_world_map, 9.0, 0.04);
  moved.begin(map * Eigen::Vector2d(3.0, 4.0), world * T_world_map * inverse(map), 9.0, 0.04);
  for (int i = 0; i < 100; ++i) {
    PlacedFix fix;
    fix.stamp_ns = nanoseconds(1.0 + 0.2 * i);
    fix.antenna_m = normals(random, 10.0);
    fix.fix_world_m = T_world_map * fix.antenna_m + normals(random, 0.5);
    place.add(fix, 0.0);
    fix.antenna_m = map * fix.antenna_m;
    fix.fix_world_m = world * fix.fix_world_m;
    moved.add(fix, 0.0);
  }
  const Pose2 expected = world * place.T_world_map() * inverse(map);
  EXPECT_LT((moved.T_world_map().translation_m - expected.translation_m).norm(), 1e-8);
  EXPECT_NEAR(wrap_to_pi(moved.T_world_map().yaw_rad - expected.yaw_rad), 0.0, 1e-9);
}

TEST(MapPlace, LeavesOutAFixThatIsFarOff) {
  MapPlace place;
  place.begin(Eigen::Vector2d::Zero(), {}, 9.0, 0.01);
  for (int i = 0; i < 50; ++i) {
    PlacedFix fix;
    fix.stamp_ns = nanoseconds(1.0 + 0.2 * i);
    fix.antenna_m = Eigen::Vector2d(0.5 * i, 0.0);
    fix.fix_world_m = fix.antenna_m;
    EXPECT_TRUE(place.add(fix, 0.0));
  }
  const Pose2 before = place.T_world_map();
  PlacedFix outlier;
  outlier.stamp_ns = nanoseconds(11.2);
  outlier.fix_world_m = Eigen::Vector2d(30.0, 0.0);
  EXPECT_FALSE(place.add(outlier, 0.0));
  EXPECT_LT((place.T_world_map().translation_m - before.translation_m).norm(), 1e-9);
}

}  // namespace
}  // namespace situation_awareness::map_place_test

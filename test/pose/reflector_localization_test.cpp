// SPDX-License-Identifier: BSD-3-Clause
#include "situation_awareness/pose/reflector_localization.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <functional>
#include <string>
#include <utility>
#include <vector>

#include <Eigen/Eigenvalues>

#include "pose/reflector_drive.hpp"
#include "support/consistency.hpp"
#include "support/covariance.hpp"
#include "support/manifold_jacobian.hpp"
#include "support/numerical_jacobian.hpp"
#include "support/random_gaussian.hpp"
#include "support/refusal.hpp"

namespace situation_awareness::reflector_localization_test {
namespace {

Pose2 random_pose(Random& random) {
  return {{random.uniform(-5.0, 5.0), random.uniform(-5.0, 5.0)}, random.uniform(-kPi, kPi)};
}

ReflectorState random_state(Random& random) {
  return {random_pose(random), {random.uniform(-0.1, 0.1), random.uniform(-0.1, 0.1)}, random.uniform(-0.1, 0.1)};
}

// --- models ----------------------------------------------------------------------------------------------------------

TEST(ReflectorModels, JacobiansEqualNumericalOnes) {
  Random random(1);
  for (int i = 0; i < 100; ++i) {
    const ReflectorState x = random_state(random);
    const Pose2 u =
        exp_se2(Eigen::Vector3d(random.uniform(-1.0, 1.0), random.uniform(-1.0, 1.0), random.uniform(-2.0, 2.0)));
    const double turn_rad = random.uniform(-2.0, 2.0);
    const auto F = manifold_jacobian<ReflectorState>(
        [&](const ReflectorState& at) { return moved_by_odometry(at, u, turn_rad); }, x);
    EXPECT_LT((F - moved_by_odometry_jacobian(x, u, turn_rad)).cwiseAbs().maxCoeff(), 1e-7);

    const Pose2 T_base_lidar = random_pose(random);
    const Eigen::Vector2d l =
        x.T_world_base * (T_base_lidar * Eigen::Vector2d(random.uniform(0.5, 5.0), random.uniform(-3.0, 3.0)));
    const auto H = manifold_jacobian<Eigen::Vector2d>(
        [&](const Pose2& at) { return observed_reflector(at, T_base_lidar, l); }, x.T_world_base);
    EXPECT_LT((H - observed_reflector_jacobian(x.T_world_base, T_base_lidar, l)).cwiseAbs().maxCoeff(), 1e-7);
  }
}

TEST(ReflectorModels, TheStateIsAManifold) {
  Random random(2);
  using M = Manifold<ReflectorState>;
  for (int i = 0; i < 50; ++i) {
    const ReflectorState x = random_state(random);
    const M::Error e = 0.5 * normal_vector<6>(random);
    EXPECT_LT((M::local_coordinates(x, M::retract(x, e)) - e).norm(), 1e-9);
    const ReflectorState at_e = M::retract(x, e);
    const auto G =
        numerical_jacobian<6, 6>([&](const M::Error& d) { return M::local_coordinates(at_e, M::retract(x, d)); }, e);
    EXPECT_LT((G - M::reset_jacobian(e)).cwiseAbs().maxCoeff(), 1e-7);
  }
}

TEST(ReflectorModels, StandingStillAddsNoNoise) {
  EXPECT_EQ(odometry_noise({}, {}, {0.1, 0.1, 0.1}), (Eigen::Matrix<double, 6, 6>::Zero()));
}

// --- accuracy --------------------------------------------------------------------------------------------------------

struct Accuracy {
  double position_rms_m = 0.0, yaw_rms_rad = 0.0, nees = 0.0, nis = 0.0, matched = 0.0;
};

Accuracy accuracy(std::size_t reflectors, double speed_m_s, double sweep_s, bool use_sweep = true, int seeds = 50) {
  Accuracy sum;
  int n = 0, matches = 0;
  double nis = 0.0;
  for (int seed = 0; seed < seeds; ++seed) {
    Random random(static_cast<std::uint64_t>(5000 + seed));
    const ReflectorMap map = map_of(reflectors, &random);
    ReflectorWorld world = room_with(map);
    world.path = winding_path(speed_m_s);
    world.sweep_s = sweep_s;
    world.T_base_lidar = {{0.2, -0.05}, radians(5.0)};
    Drive drive(map, world, static_cast<std::uint64_t>(100 + seed));
    drive.use_sweep = use_sweep;
    drive.guess();
    for (int scan = 0; scan < 150; ++scan) {
      const ReflectorUpdate& update = drive.scan();
      if (scan < 25 || !update.is_known) continue;
      const Eigen::Vector3d error = drive.error();
      sum.position_rms_m += error.head<2>().squaredNorm();
      sum.yaw_rms_rad += error(2) * error(2);
      sum.nees += drive.squared_error();
      nis += update.nis;
      matches += static_cast<int>(update.matches.size());
      ++n;
    }
  }
  EXPECT_GT(n, 124 * seeds);
  Accuracy result;
  result.position_rms_m = std::sqrt(sum.position_rms_m / n);
  result.yaw_rms_rad = std::sqrt(sum.yaw_rms_rad / n);
  result.nees = sum.nees / n;
  result.nis = nis / (2.0 * matches);
  result.matched = static_cast<double>(matches) / n;
  ::testing::Test::RecordProperty("position_rms_um", static_cast<int>(1e6 * result.position_rms_m));
  std::printf("%zu reflectors, %.1f m/s, sweep %.0f ms: RMS %.2f mm, %.2f mrad, NEES %.2f, NIS %.2f, %.2f matches\n",
              reflectors, speed_m_s, 1e3 * sweep_s, 1e3 * result.position_rms_m, 1e3 * result.yaw_rms_rad, result.nees,
              result.nis, result.matched);
  return result;
}

// The errors of successive scans are correlated, so that no bound of a chi-square sum over all of them applies; over
// the seeds the mean NEES, 3 if consistent, must be in [2, 4].
TEST(ReflectorLocalizationStatistics, ThreeReflectorsGiveMillimetresAndAnHonestCovariance) {
  for (const double speed_m_s : {0.3, 1.0}) {
    const Accuracy of = accuracy(3, speed_m_s, 0.0);
    EXPECT_LT(of.position_rms_m, 3e-3);
    EXPECT_LT(of.yaw_rms_rad, 1e-3);
    EXPECT_GT(of.nees, 2.0);
    EXPECT_LT(of.nees, 4.0);
    EXPECT_GT(of.matched, 2.97);
    EXPECT_NEAR(of.nis, 1.0, 0.2);
  }
}

// Fig. 5 of the polygons paper has standard deviations of up to 6 mm and 20 mrad. The scanner is not ideal: its beams
// have a width, and the flanks of the reflectors return less light.
TEST(ReflectorPoseStatistics, WithThreeInSightItIsKnownTo3MillimetresAnd2MilliradiansAndNoWorseThanItSays) {
  constexpr int kSeeds = 50, kFirst = 25, kLast = 150;
  double sum = 0.0;
  int n = 0, too_uncertain = 0, beyond_three_sigma = 0;
  for (int seed = 0; seed < kSeeds; ++seed) {
    Random random(static_cast<std::uint64_t>(7000 + seed));
    const ReflectorMap map = map_of(3, &random);
    ReflectorWorld world = room_with(map);
    world.path = winding_path(0.5);
    world.T_base_lidar = {{0.2, -0.05}, radians(5.0)};
    world.beam_width_rad = 0.003;
    for (ReflectorWorld::Cylinder& cylinder : world.cylinders) cylinder.falls = true;
    Drive drive(map, world, static_cast<std::uint64_t>(700 + seed));
    drive.guess();
    for (int scan = 0; scan < kLast; ++scan) {
      drive.scan();
      if (scan < kFirst) continue;
      ASSERT_TRUE(drive.localization.is_known());
      sum += drive.squared_error();
      ++n;
      const LocalizedPose pose = drive.localization.pose();
      const Eigen::Matrix3d& P = pose.covariance_world;
      if (!(std::sqrt(std::max(P(0, 0), P(1, 1))) <= 3e-3 && std::sqrt(P(2, 2)) <= 2e-3)) ++too_uncertain;
      const Eigen::Vector2d off_m = pose.T_world_base.x.translation_m - drive.world.path(drive.stamp_s).translation_m;
      if (off_m.squaredNorm() > 9.0 * (P(0, 0) + P(1, 1))) ++beyond_three_sigma;
    }
  }
  const double mean = sum / n;
  std::printf("three in sight: NEES %.2f, %d of %d scans beyond 3 mm or 2 mrad\n", mean, too_uncertain, n);
  // Where wheels turned by more than four of their standard deviations a scan contradicts the pose, which adds 3 cm.
  EXPECT_LE(too_uncertain, n / 500);
  // The errors of the scans of a drive are correlated; the band is that of one scan for each seed, which is wider.
  EXPECT_GT(mean, chi_square_quantile(0.025, 3 * kSeeds) / kSeeds);
  EXPECT_LT(mean, chi_square_quantile(0.975, 3 * kSeeds) / kSeeds);
  EXPECT_LT(beyond_three_sigma, n / 100);
}

TEST(ReflectorLocalizationStatistics, TwoReflectorsDoAlmostAsWell) {
  const Accuracy of = accuracy(2, 0.5, 0.0);
  EXPECT_LT(of.position_rms_m, 3.5e-3);
  EXPECT_LT(of.yaw_rms_rad, 1.5e-3);
  EXPECT_GT(of.nees, 2.0);
  EXPECT_LT(of.nees, 4.0);
}

// Within a sweep the wheels' random errors of yaw, 0.02 rad/sqrt(rad), are as large as those of the scanner.
TEST(ReflectorLocalizationStatistics, EverySightingHasItsOwnTimeInTheSweep) {
  const Accuracy of = accuracy(3, 0.5, 0.03);
  EXPECT_LT(of.position_rms_m, 3e-3);
  EXPECT_LT(of.yaw_rms_rad, 1.6e-3);
  EXPECT_GT(of.nees, 2.0);
  EXPECT_LT(of.nees, 4.0);
  const Accuracy ignored = accuracy(3, 0.5, 0.03, false, 10);
  EXPECT_GT(ignored.position_rms_m, 2.5 * of.position_rms_m);
}

// While the robot stands the same beams see the same things: no mean over scans makes the pose as certain as
// independent scans would.
TEST(ReflectorLocalizationStatistics, StandingStillDoesNotMakeItCertain) {
  double sum = 0.0;
  constexpr int kSeeds = 50;
  for (int seed = 0; seed < kSeeds; ++seed) {
    Random random(static_cast<std::uint64_t>(9000 + seed));
    const ReflectorMap map = map_of(3, &random);
    ReflectorWorld world = room_with(map);
    const Pose2 stand{{random.uniform(-1.0, 1.0), random.uniform(-1.0, 1.0)}, random.uniform(-kPi, kPi)};
    world.path = [stand](double) { return stand; };
    Drive drive(map, world, static_cast<std::uint64_t>(seed));
    drive.guess();
    for (int scan = 0; scan < 250; ++scan) drive.scan();
    sum += drive.squared_error();
  }
  std::printf("standing for 10 s: NEES %.2f\n", sum / kSeeds);
  EXPECT_GT(sum / kSeeds, 1.5);
  EXPECT_LT(sum / kSeeds, 6.0);
}

// Without light on the reflectors, over some 6 m.
TEST(ReflectorLocalizationStatistics, DeadReckoningIsHonest) {
  double sum = 0.0, least_sigma_m = 1.0;
  constexpr int kSeeds = 50;
  for (int seed = 0; seed < kSeeds; ++seed) {
    const ReflectorMap map = map_of(3);
    ReflectorWorld world = room_with(map);
    world.path = winding_path(0.7);
    Drive drive(map, world, static_cast<std::uint64_t>(seed));
    drive.guess();
    for (int scan = 0; scan < 100; ++scan) drive.scan();
    for (ReflectorWorld::Cylinder& cylinder : drive.world.cylinders) cylinder.intensity = 100.0;
    for (int scan = 0; scan < 200; ++scan) drive.scan();
    ASSERT_TRUE(drive.localization.is_known());
    sum += drive.squared_error();
    const Eigen::Matrix3d P = drive.localization.pose().covariance_world;
    least_sigma_m = std::min(least_sigma_m, std::sqrt(P(0, 0) + P(1, 1)));
  }
  std::printf("dead reckoning: NEES %.2f, at least %.0f mm\n", sum / kSeeds, 1e3 * least_sigma_m);
  EXPECT_GT(least_sigma_m, 0.03);  // required for a meaningful test
  EXPECT_GT(sum / kSeeds, 1.5);
  EXPECT_LT(sum / kSeeds, 4.2);
}

// The scale errors of wheels are learned.
TEST(ReflectorLocalization, LearnsTheScaleOfDistances) {
  const ReflectorMap map = map_of(4);
  ReflectorWorld world = room_with(map);
  world.path = winding_path(0.7);
  Drive drive(map, world, 3);
  // Wheels that say 4 % less than they drive.
  Pose2 before, scaled;
  bool has_before = false;
  drive.adjust_odometry = [&](const Pose2& T) {
    if (has_before) {
      Eigen::Vector3d tau = log_se2(inverse(before) * T);
      tau.head<2>() *= 0.96;
      scaled = scaled * exp_se2(tau);
    }
    before = T;
    has_before = true;
    return scaled;
  };
  drive.guess();
  for (int scan = 0; scan < 750; ++scan) drive.scan();
  ASSERT_TRUE(drive.localization.is_known());
  EXPECT_NEAR(drive.localization.state().x.scale_error(0), 0.04, 0.025);
  EXPECT_LT(drive.error().head<2>().norm(), 0.01);
}

/// What wheels say on a drive if they miss some of each turn and of each way forward.
std::function<Pose2(const Pose2&)> turning_less(double turn_part, double yaw_rad_m) {
  return [=, before = Pose2{}, result = Pose2{}, has_before = false](const Pose2& T) mutable {
    if (has_before) {
      Eigen::Vector3d tau = log_se2(inverse(before) * T);
      tau(2) -= turn_part * tau(2) + yaw_rad_m * tau(0);
      result = result * exp_se2(tau);
    }
    before = T;
    has_before = true;
    return result;
  };
}

TEST(ReflectorLocalization, LearnsTheTurnsThatWheelsMiss) {
  const ReflectorMap map = map_of(4);
  ReflectorWorld world = room_with(map);
  world.path = winding_path(0.7);
  Drive drive(map, world, 3);
  drive.adjust_odometry = turning_less(0.08, 0.02);
  drive.guess();
  for (int scan = 0; scan < 750; ++scan) drive.scan();
  ASSERT_TRUE(drive.localization.is_known());
  const Estimate<ReflectorState>& state = drive.localization.state();
  EXPECT_NEAR(state.x.scale_error(1), 0.08 / 0.92, 0.04);
  EXPECT_NEAR(state.x.yaw_drift_rad_m, 0.02, 0.01);
  EXPECT_LT(state.P(5, 5), std::pow(0.6 * ReflectorLocalizationParams{}.wheels.yaw_drift_sigma, 2));
}

// On a straight way all turns that odometry says are its noise.
TEST(ReflectorLocalizationStatistics, AStraightWayTeachesNothingOfTheScaleOfTurns) {
  double sum = 0.0;
  constexpr int kSeeds = 20;
  for (int seed = 0; seed < kSeeds; ++seed) {
    const ReflectorMap map = map_of(4);
    ReflectorWorld world = room_with(map);
    world.path = [](double t_s) { return Pose2{{-4.4 + 0.4 * t_s, 0.0}, 0.0}; };
    Drive drive(map, world, static_cast<std::uint64_t>(seed));
    drive.guess();
    for (int scan = 0; scan < 540; ++scan) drive.scan();
    const Estimate<ReflectorState>& state = drive.localization.state();
    sum += state.x.scale_error(1);
  }
  EXPECT_LT(std::abs(sum / kSeeds), 0.06);
}

// The wheels are the same wherever the robot is.
TEST(ReflectorLocalization, KnowsTheWheelsAfterItWasRelocated) {
  const ReflectorMap map = map_of(4);
  ReflectorWorld world = room_with(map);
  world.path = winding_path(0.7);
  Drive drive(map, world, 4);
  drive.guess();
  for (int scan = 0; scan < 750; ++scan) drive.scan();
  const Estimate<ReflectorState> before = drive.localization.state();
  const ReflectorLocalizationParams params;
  ASSERT_LT(std::sqrt(before.P(4, 4)), 0.3 * params.wheels.yaw_scale_sigma);  // required for a meaningful test
  drive.localization.relocate();
  for (int scan = 0; scan < 25; ++scan) drive.scan();
  ASSERT_TRUE(drive.localization.is_known());
  const Estimate<ReflectorState> after = drive.localization.state();
  for (const Eigen::Index i : {0, 1}) {
    EXPECT_NEAR(after.x.scale_error(i), before.x.scale_error(i), 3.0 * std::sqrt(after.P(3 + i, 3 + i)));
    EXPECT_GT(after.P(3 + i, 3 + i), before.P(3 + i, 3 + i));
    EXPECT_LT(after.P(3 + i, 3 + i), 5.0 * before.P(3 + i, 3 + i));
  }
}

// --- first pose, loss ------------------------------------------------------------------------------------------------

TEST(ReflectorLocalization, FindsItsFirstPoseWithoutAGuess) {
  for (std::uint64_t seed = 0; seed < 30; ++seed) {
    Random random(300 + seed);
    const ReflectorMap map = map_of(3 + seed % 3, &random);
    ReflectorWorld world = room_with(map);
    world.path = winding_path(0.5);
    world.sweep_s = 0.03;
    Drive drive(map, world, seed);
    bool was_found = false;
    for (int scan = 0; scan < 40; ++scan) was_found = drive.scan().is_found || was_found;
    EXPECT_TRUE(was_found);
    ASSERT_TRUE(drive.localization.is_known()) << seed;
    EXPECT_LT(drive.error().head<2>().norm(), 0.02) << seed;
    EXPECT_LT(std::abs(drive.error()(2)), 0.01) << seed;
  }
}

TEST(ReflectorLocalization, SaysWhyItHasNoPose) {
  const double h = std::sqrt(3.0);
  ReflectorMap regular;
  for (const Eigen::Vector2d& center :
       {Eigen::Vector2d(2.0, 0.0), Eigen::Vector2d(-1.0, h), Eigen::Vector2d(-1.0, -h)}) {
    regular.reflectors.push_back({center, 0.05});
  }
  Drive ambiguous(regular, room_with(regular), 1);
  EXPECT_STREQ(ambiguous.scan().reason, "no pose yet");
  for (int scan = 0; scan < 10; ++scan) ambiguous.scan();
  EXPECT_STREQ(ambiguous.scan().reason, "ambiguous");
  EXPECT_FALSE(ambiguous.localization.is_known());

  const ReflectorMap two = map_of(2);
  Drive few(two, room_with(two), 1);
  for (int scan = 0; scan < 10; ++scan) few.scan();
  EXPECT_STREQ(few.scan().reason, "too few places");

  ReflectorLocalization without(two, {});
  EXPECT_STREQ(without.update(few.sightings, {}).reason, "no odometry");
  EXPECT_STREQ(without.update(few.sightings, {}).reason, "scan out of order");
}

// What an update does not use leaves the pose at an earlier stamp, where the robot is no longer.
TEST(ReflectorLocalization, ThePoseIsKnownOnlyAtTheStampOfTheScan) {
  const ReflectorMap map = map_of(6);
  ReflectorWorld world = room_with(map);
  world.path = winding_path(0.4);
  Drive drive(map, world, 1);
  drive.guess();
  for (int scan = 0; scan < 20; ++scan) ASSERT_TRUE(drive.scan().is_known);

  const ReflectorUpdate& again = drive.localization.update(drive.sightings, world.T_base_lidar);
  EXPECT_FALSE(again.is_known);
  EXPECT_STREQ(again.reason, "scan out of order");

  drive.scans += 150;  // the scanner is silent while the robot drives on
  int known = 0;
  for (int scan = 0; scan < 10; ++scan) {
    const ReflectorUpdate& update = drive.scan();
    if (!update.is_known) {
      EXPECT_STREQ(update.reason, "scan of another time");
      continue;
    }
    ++known;
    EXPECT_LT(drive.error().head<2>().norm(), 0.1);
  }
  EXPECT_EQ(known, 10 - StampOrder::kAgreeing + 1);
  EXPECT_TRUE(drive.localization.is_known());
}

// A guess with errors of 2.5 standard deviations or less, as its errors are drawn; reflectors close to each other,
// which a greedy choice confuses.
TEST(ReflectorLocalization, AGuessIsMatchedJointly) {
  for (std::uint64_t seed = 0; seed < 100; ++seed) {
    Random random(800 + seed);
    ReflectorMap map = map_of(4, &random);
    map.reflectors.push_back({map.reflectors[0].center_world_m + Eigen::Vector2d(0.35, 0.25), 0.05});
    ReflectorWorld world = room_with(map);
    world.path = winding_path(0.4);
    Drive drive(map, world, seed);
    drive.guess();
    for (int scan = 0; scan < 50; ++scan) drive.scan();
    ASSERT_TRUE(drive.localization.is_known()) << seed;
    EXPECT_LT(drive.error().head<2>().norm(), 0.02) << seed;
  }
}

TEST(ReflectorLocalization, FindsItselfAfterItWasCarriedAway) {
  for (std::uint64_t seed = 0; seed < 10; ++seed) {
    const ReflectorMap map = map_of(4);
    ReflectorWorld world = room_with(map);
    world.path = winding_path(0.4);
    Drive drive(map, world, seed);
    drive.guess();
    for (int scan = 0; scan < 50; ++scan) drive.scan();
    const auto before = drive.world.path;
    // Its wheels do not notice.
    drive.world.path = [before](double t_s) { return Pose2{{0.9, -0.7}, 2.0} * before(t_s); };
    bool was_contradicted = false, was_found = false;
    for (int scan = 0; scan < 75; ++scan) {
      const ReflectorUpdate& update = drive.scan();
      was_contradicted = was_contradicted || update.is_contradicted;
      was_found = was_found || update.is_found;
    }
    EXPECT_TRUE(was_contradicted) << seed;
    EXPECT_TRUE(was_found) << seed;
    ASSERT_TRUE(drive.localization.is_known()) << seed;
    EXPECT_LT(drive.error().head<2>().norm(), 0.05) << seed;
  }
}

TEST(ReflectorLocalization, RelocatesWhenTold) {
  const ReflectorMap map = map_of(4);
  Drive drive(map, room_with(map), 2);
  drive.localization.initial_pose(nanoseconds(0.1), {{2.0, 2.0}, 1.0}, 0.01, 0.01);  // wrong
  drive.scan();
  drive.localization.relocate();
  EXPECT_FALSE(drive.localization.is_known());
  for (int scan = 0; scan < 10; ++scan) drive.scan();
  ASSERT_TRUE(drive.localization.is_known());
  EXPECT_LT(drive.error().head<2>().norm(), 0.02);
}

// --- reflectors ------------------------------------------------------------------------------------------------------

TEST(ReflectorLocalization, ReportsAMissingReflector) {
  const ReflectorMap map = map_of(5);
  ReflectorWorld world = room_with(map);
  world.path = winding_path(0.5);
  world.cylinders.erase(world.cylinders.begin() + 2);
  Drive drive(map, world, 4);
  drive.guess();
  for (int scan = 0; scan < 60; ++scan) drive.scan();
  EXPECT_EQ(drive.scan().missing, (std::vector<int>{2}));
  EXPECT_LT(drive.error().head<2>().norm(), 0.01);
}

TEST(ReflectorLocalization, AHiddenReflectorIsNotMissing) {
  const ReflectorMap map = map_of(4);
  ReflectorWorld world = room_with(map);
  const Eigen::Vector2d l = map.reflectors[1].center_world_m;
  world.walls.push_back({0.6 * l + Eigen::Vector2d(-0.5, -0.4), 0.6 * l + Eigen::Vector2d(0.5, 0.4)});
  Drive drive(map, world, 5);
  drive.guess();
  for (int scan = 0; scan < 60; ++scan) drive.scan();
  const ReflectorUpdate& update = drive.scan();
  EXPECT_EQ(update.matches.size(), 3U);
  EXPECT_TRUE(update.missing.empty());
}

// The reflector itself is hidden, and something bright stands half a metre from it.
TEST(ReflectorLocalization, ABrightThingBesideAHiddenReflectorIsNoMovedOne) {
  const ReflectorMap map = map_of(5);
  ReflectorWorld world = room_with(map);
  const Eigen::Vector2d l = map.reflectors[1].center_world_m;
  world.walls.push_back({0.9 * l + Eigen::Vector2d(-0.2, -0.16), 0.9 * l + Eigen::Vector2d(0.2, 0.16)});
  world.cylinders.push_back({l + Eigen::Vector2d(0.5, 0.1), 0.05, 700.0});
  Drive drive(map, world, 5);
  drive.guess();
  for (int scan = 0; scan < 100; ++scan) drive.scan();
  const ReflectorUpdate& update = drive.scan();
  EXPECT_EQ(update.matches.size(), 4U);
  EXPECT_EQ(update.unmatched.size(), 1U);
  EXPECT_TRUE(update.moved.empty());
  EXPECT_TRUE(update.missing.empty());
}

// Three bright things and a moved reflector, and none in its place: the things were there before.
TEST(ReflectorLocalization, WhatShoneBeforeIsNoSignOfAnotherPose) {
  const ReflectorMap map = map_of(5);
  ReflectorWorld world = room_with(map);
  world.path = winding_path(0.5);
  for (const Eigen::Vector2d& at_m :
       {Eigen::Vector2d(2.4, 0.3), Eigen::Vector2d(-2.5, 0.2), Eigen::Vector2d(0.2, 2.4)}) {
    world.cylinders.push_back({at_m, 0.05, 800.0});
  }
  Drive drive(map, world, 6);
  drive.guess();
  for (int scan = 0; scan < 60; ++scan) drive.scan();
  ASSERT_GE(drive.scan().matches.size(), 3U);
  const auto take_away = [&](std::size_t reflector) {
    drive.world.cylinders[reflector].center_m += Eigen::Vector2d(500.0, 0.0);
  };
  for (const std::size_t reflector : {0U, 1U, 2U}) take_away(reflector);
  drive.world.cylinders[3].center_m += Eigen::Vector2d(0.25, 0.2);
  for (int scan = 0; scan < 10; ++scan) drive.scan();  // with one in its place
  take_away(4);
  for (int scan = 0; scan < 20; ++scan) {
    const ReflectorUpdate& update = drive.scan();
    EXPECT_FALSE(update.is_contradicted);
    EXPECT_TRUE(update.matches.empty());
  }
}

TEST(ReflectorLocalization, ReportsAMovedReflectorAndUsesItAgainWhenItIsBack) {
  const ReflectorMap map = map_of(5);
  ReflectorWorld world = room_with(map);
  world.path = winding_path(0.5);
  Drive drive(map, world, 6);
  drive.guess();
  for (int scan = 0; scan < 50; ++scan) drive.scan();
  const Eigen::Vector2d away_m(0.18, 0.12);
  drive.world.cylinders[3].center_m += away_m;
  for (int scan = 0; scan < 50; ++scan) drive.scan();
  const ReflectorUpdate& update = drive.scan();
  ASSERT_EQ(update.moved.size(), 1U);
  EXPECT_EQ(update.moved[0].reflector, 3);
  EXPECT_LT((update.moved[0].center_world_m - drive.world.cylinders[3].center_m).norm(), 0.03);
  EXPECT_EQ(update.matches.size(), 4U);
  EXPECT_LT(drive.error().head<2>().norm(), 0.01);
  drive.world.cylinders[3].center_m -= away_m;
  for (int scan = 0; scan < 50; ++scan) drive.scan();
  EXPECT_TRUE(drive.scan().moved.empty());
  EXPECT_EQ(drive.scan().matches.size(), 5U);
}

// Glossy posts stand about, and bright trousers walk past the reflectors.
TEST(ReflectorLocalization, FalseSightingsDoNotMatter) {
  for (std::uint64_t seed = 0; seed < 10; ++seed) {
    const ReflectorMap map = map_of(4);
    ReflectorWorld world = room_with(map);
    world.path = winding_path(0.5);
    world.cylinders.push_back({{2.0, 3.0}, 0.06, 700.0});
    world.cylinders.push_back({{-3.5, 1.0}, 0.04, 500.0});
    world.cylinders.push_back({{0.0, 0.0}, 0.07, 600.0});  // walks
    Drive drive(map, world, seed);
    drive.guess();
    double worst_m = 0.0;
    for (int scan = 0; scan < 250; ++scan) {
      const double t = 0.04 * scan;
      drive.world.cylinders.back().center_m = map.reflectors[static_cast<std::size_t>(scan / 63)].center_world_m +
                                              Eigen::Vector2d(std::remainder(0.8 * t, 2.0), 0.15);
      drive.scan();
      if (scan > 25) worst_m = std::max(worst_m, drive.error().head<2>().norm());
    }
    ASSERT_TRUE(drive.localization.is_known());
    EXPECT_LT(worst_m, 0.02) << seed;
  }
}

// --- symmetry --------------------------------------------------------------------------------------------------------

// The world may be moved, and so may the base on the robot: neither changes what is estimated.
TEST(ReflectorLocalization, RigidMotionsOfTheWorldMoveThePoseAndLeaveItsCovariance) {
  const ReflectorMap map = map_of(4);
  ReflectorWorld world = room_with(map);
  world.path = winding_path(0.5);
  world.sweep_s = 0.03;
  const Pose2 motion{{20.0, -7.0}, 2.1};
  ReflectorMap moved = map;
  for (Reflector& reflector : moved.reflectors) reflector.center_world_m = motion * reflector.center_world_m;
  ReflectorLocalization here(map, {}), there(moved, {});
  DriftingWheels wheels(world.path, 9);
  Random random(9);
  here.initial_pose(nanoseconds(0.1), world.path(0.1), 0.1, 0.05);
  there.initial_pose(nanoseconds(0.1), motion * world.path(0.1), 0.1, 0.05);
  for (int scan = 0; scan < 100; ++scan) {
    const double time_s = 0.1 + 0.04 * scan;
    while (wheels.next_time_s() < time_s + 0.045) {
      const auto [stamp_ns, T] = wheels.next();
      here.add_odometry(stamp_ns, T);
      there.add_odometry(stamp_ns, T);
    }
    const ReflectorSightings sightings = detect_reflectors(world.points(time_s, random), {});
    here.update(sightings, world.T_base_lidar);
    there.update(sightings, world.T_base_lidar);
  }
  const LocalizedPose a = here.pose(), b = there.pose();
  EXPECT_LT(Manifold<Pose2>::local_coordinates(motion * a.T_world_base.x, b.T_world_base.x).norm(), 1e-8);
  EXPECT_LT((a.T_world_base.P - b.T_world_base.P).cwiseAbs().maxCoeff(), 1e-10);
  Eigen::Matrix3d B = Eigen::Matrix3d::Identity();
  B.topLeftCorner<2, 2>() = motion.rotation();
  EXPECT_LT((B * a.covariance_world * B.transpose() - b.covariance_world).cwiseAbs().maxCoeff(), 1e-10);
}

// The lidar turned on the robot, and the scan with it: the same directions in the base, the same pose.
TEST(ReflectorLocalization, TheMountingMayBeAnything) {
  const ReflectorMap map = map_of(4);
  for (const double turn_rad : {0.0, 0.5 * kPi, 2.0 * kPi / 3.0}) {
    ReflectorWorld world = room_with(map);
    world.path = winding_path(0.5);
    world.T_base_lidar = {{0.3, 0.1}, turn_rad};
    Drive drive(map, world, 11);
    drive.guess();
    for (int scan = 0; scan < 100; ++scan) drive.scan();
    ASSERT_TRUE(drive.localization.is_known());
    EXPECT_LT(drive.error().head<2>().norm(), 0.01) << turn_rad;
    EXPECT_LT(std::abs(drive.error()(2)), 0.004) << turn_rad;
  }
}

// --- odometry --------------------------------------------------------------------------------------------------------

TEST(ReflectorLocalization, OutlivesJumpsOfOdometry) {
  const ReflectorMap map = map_of(4);
  ReflectorWorld world = room_with(map);
  world.path = winding_path(0.5);
  Drive drive(map, world, 12);
  drive.guess();
  for (int scan = 0; scan < 50; ++scan) drive.scan();
  const Pose2 jump{{3.0, 9.0}, -1.0};
  drive.adjust_odometry = [&](const Pose2& T) { return jump * T; };
  double worst_m = 0.0;
  for (int scan = 0; scan < 50; ++scan) {
    drive.scan();
    ASSERT_TRUE(drive.localization.is_known());
    worst_m = std::max(worst_m, drive.error().head<2>().norm());
  }
  EXPECT_LT(worst_m, 0.03);
  EXPECT_EQ(drive.localization.counters().of("odometry jumped"), 1U);
}

// Scans may stop for longer than odometry is kept.
TEST(ReflectorLocalization, KeepsThePoseWhileNoScansCome) {
  const ReflectorMap map = map_of(4);
  ReflectorWorld world = room_with(map);
  world.path = winding_path(0.3);
  Drive drive(map, world, 13);
  drive.guess();
  for (int scan = 0; scan < 50; ++scan) drive.scan();
  const double sigma_m = std::sqrt(drive.localization.pose().covariance_world(0, 0));
  drive.scans += 25 * 20;  // 20 s: twice of what is kept
  drive.localization.trust_scan_stamps();
  drive.world.cylinders.clear();
  drive.world.walls.clear();
  drive.scan();
  ASSERT_TRUE(drive.localization.is_known());
  EXPECT_GT(std::sqrt(drive.localization.pose().covariance_world(0, 0)), 5.0 * sigma_m);
  EXPECT_LT(drive.squared_error(), chi_square_quantile(0.999, 3));
}

TEST(ReflectorLocalization, SaysForHowLongReflectorsDidNotSuffice) {
  const ReflectorMap map = map_of(4);
  ReflectorWorld world = room_with(map);
  world.path = winding_path(0.5);
  Drive drive(map, world, 15);
  drive.localization.initial_pose(nanoseconds(drive.time_s()), drive.truth(), 0.01, 0.01);
  const auto light = [&](std::size_t reflectors) {
    for (std::size_t i = 0; i < map.reflectors.size(); ++i) {
      drive.world.cylinders[i].intensity = i < reflectors ? 800.0 : 100.0;
    }
  };
  double sigma_m = 0.0, sigma_rad = 0.0;
  const auto scan = [&](int scans) {
    for (int i = 0; i < scans; ++i) drive.scan();
    const Eigen::Matrix3d P = drive.localization.pose().covariance_world;
    sigma_m = std::sqrt(Eigen::SelfAdjointEigenSolver<Eigen::Matrix2d>(P.topLeftCorner<2, 2>()).eigenvalues()(1));
    sigma_rad = std::sqrt(P(2, 2));
  };
  scan(51);
  EXPECT_NEAR(drive.localization.coverage().all_s, 2.0, 1e-6);
  EXPECT_EQ(drive.localization.coverage().too_few_s, 0.0);
  light(1);
  scan(25);
  EXPECT_NEAR(drive.localization.coverage().too_few_now_s, 1.0, 1e-6);
  light(2);
  scan(25);
  light(0);
  scan(100);
  const ReflectorCoverage& coverage = drive.localization.coverage();
  EXPECT_NEAR(coverage.longest_s, 4.0, 1e-6);
  EXPECT_NEAR(coverage.largest_sigma_m, sigma_m, 1e-9);
  EXPECT_NEAR(coverage.largest_sigma_rad, sigma_rad, 1e-9);
  const double worst_m = sigma_m;
  light(4);
  scan(50);
  EXPECT_EQ(coverage.too_few_now_s, 0.0);
  EXPECT_NEAR(coverage.too_few_s, 5.0, 1e-6);
  EXPECT_NEAR(coverage.all_s, 10.0, 1e-6);
  EXPECT_EQ(coverage.largest_sigma_m, worst_m);
}

TEST(ReflectorLocalization, ATimeResetForgetsThePose) {
  const ReflectorMap map = map_of(4);
  Drive drive(map, room_with(map), 14);
  drive.guess();
  for (int scan = 0; scan < 100; ++scan) drive.scan();
  ASSERT_TRUE(drive.localization.is_known());
  drive.scans = 0;
  drive.wheels = DriftingWheels(drive.world.path, 3);
  EXPECT_FALSE(drive.scan().is_known);
  EXPECT_EQ(drive.localization.counters().of("odometry restarted"), 1U);
  for (int scan = 0; scan < 10; ++scan) drive.scan();
  EXPECT_TRUE(drive.localization.is_known());
}

TEST(ReflectorLocalizationParams, RefusalsNameFieldAndBound) {
  const auto refused = [](auto change) {
    ReflectorLocalizationParams params;
    change(params);
    return refusal_of([&] { ReflectorLocalization(map_of(1), params); });
  };
  EXPECT_EQ(refused([](ReflectorLocalizationParams&) {}), "");
  EXPECT_TRUE(names(refused([](auto& p) { p.max_sigma_m = 0.0; }), {"localization.max_sigma_m", "0"}));
  EXPECT_TRUE(names(refused([](auto& p) { p.max_sigma_rad = 9.0; }), {"localization.max_sigma_rad", "9"}));
  EXPECT_TRUE(
      names(refused([](auto& p) { p.wheels.lateral_noise = -1.0; }), {"localization.wheels.lateral_noise", "-1"}));
}

}  // namespace
}  // namespace situation_awareness::reflector_localization_test

// SPDX-License-Identifier: BSD-3-Clause
#include "situation_awareness/pose/reflectors.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <limits>
#include <string>

#include <Eigen/LU>

#include "pose/reflector_world.hpp"
#include "support/refusal.hpp"

namespace situation_awareness::reflectors_test {
namespace {

/// A cylinder far before the walls of a hall, the scanner in its middle.
ReflectorWorld hall(const Eigen::Vector2d& center_m, double radius_m = 0.05, double intensity = 800.0) {
  ReflectorWorld world;
  world.add_room({-12.0, -12.0}, {12.0, 12.0});
  world.cylinders.push_back({center_m, radius_m, intensity});
  return world;
}

ReflectorSightings seen(const ReflectorWorld& world, Random& random, const ReflectorDetectionParams& params = {}) {
  return detect_reflectors(world.points(0.0, random), params);
}

TEST(Reflectors, AreFoundWhereTheyStand) {
  Random random(1);
  for (const double range_m : {0.6, 1.0, 2.0, 4.0, 7.0}) {
    for (const double azimuth_rad : {-2.2, -0.5, 0.0, 1.1, 2.2}) {
      const Eigen::Vector2d center_m = range_m * Eigen::Vector2d(std::cos(azimuth_rad), std::sin(azimuth_rad));
      const ReflectorSightings sightings = seen(hall(center_m), random);
      ASSERT_EQ(sightings.sightings.size(), 1U) << range_m << ' ' << azimuth_rad;
      EXPECT_LT((sightings.sightings[0].center_level_m - center_m).norm(), 0.05);
      EXPECT_TRUE(sightings.refused.empty());
    }
  }
}

struct FitErrors {
  int fits = 0;
  Eigen::Vector2d mean = Eigen::Vector2d::Zero();  ///< of range and azimuth
  Eigen::Vector2d rms = Eigen::Vector2d::Zero();
  double nees = 0.0;
};

FitErrors fit_errors(double range_m, ReflectorWorld world, int runs, const ReflectorDetectionParams& params = {}) {
  Random random(7);
  FitErrors errors;
  world.angle_min_rad = radians(-12.0);
  world.beams = 49;
  for (int i = 0; i < runs; ++i) {
    const double azimuth_rad = random.uniform(-0.1, 0.1), r_m = range_m + random.uniform(-0.1, 0.1);
    world.cylinders[0].center_m = r_m * Eigen::Vector2d(std::cos(azimuth_rad), std::sin(azimuth_rad));
    const ReflectorSightings sightings = seen(world, random, params);
    if (sightings.sightings.size() != 1U) continue;
    const ReflectorFit fit = fit_reflector(sightings, sightings.sightings[0], world.cylinders[0].radius_m);
    const Eigen::Vector2d error(fit.range_m - r_m, fit.azimuth_rad - azimuth_rad);
    errors.mean += error;
    errors.rms += error.cwiseAbs2();
    errors.nees += error.dot(fit.covariance.inverse() * error);
    ++errors.fits;
  }
  errors.mean /= errors.fits;
  errors.rms = (errors.rms / errors.fits).cwiseSqrt();
  errors.nees /= errors.fits;
  return errors;
}

// Bias below a tenth of the error of one beam, and covariances neither too small nor twice too large.
TEST(ReflectorFitStatistics, IsNearlyUnbiasedAndItsCovarianceIsThatOfItsErrors) {
  for (const double range_m : {0.8, 1.5, 3.0, 5.0, 7.0}) {
    const FitErrors errors = fit_errors(range_m, hall({range_m, 0.0}), 3000);
    EXPECT_GT(errors.fits, 2990) << range_m;
    EXPECT_LT(std::abs(errors.mean(0)), 1.2e-3) << range_m;
    EXPECT_LT(std::abs(errors.mean(1)), 0.1e-3) << range_m;
    EXPECT_LT(errors.rms(0), 0.013) << range_m;
    EXPECT_LT(errors.rms(1), 0.25 * radians(0.5)) << range_m;  // less than what the beams' spacing alone would give
    EXPECT_GT(errors.nees, 1.2) << range_m;
    EXPECT_LT(errors.nees, 2.3) << range_m;
  }
}

// Tape returns less light on the flanks, and beams have a width.
TEST(ReflectorFitStatistics, StaysSoForDimFlanksWideBeamsAndLostOnes) {
  ReflectorWorld dim = hall({3.0, 0.0});
  dim.cylinders[0].falls = true;
  ReflectorWorld wide = hall({2.0, 0.0});
  wide.beam_width_rad = 0.006;
  ReflectorWorld lossy = hall({2.0, 0.0});
  lossy.lost_share = 0.02;
  for (const ReflectorWorld& world : {dim, wide, lossy}) {
    const FitErrors errors = fit_errors(world.cylinders[0].center_m.norm(), world, 2000);
    EXPECT_GT(errors.fits, 1960);
    EXPECT_LT(std::abs(errors.mean(0)), 1.5e-3);
    EXPECT_LT(std::abs(errors.mean(1)), 0.15e-3);
    EXPECT_GT(errors.nees, 1.2);
    EXPECT_LT(errors.nees, 2.8);
  }
}

// Thin ones at the distances where a single beam sees them, its edges on the wall behind: seldom farther off than the
// covariance says.
TEST(ReflectorFitStatistics, SaysThatTheRangeOfASingleBeamMayBeMixed) {
  for (const double range_m : {5.0, 6.0, 8.0}) {
    ReflectorWorld world = hall({range_m, 0.0}, 0.025);
    world.add_room({-12.0, -12.0}, {range_m + 1.0, 12.0});
    world.beam_width_rad = 0.004;
    ReflectorDetectionParams as_certain;
    as_certain.fit.mixed_part = 0.0;
    EXPECT_LT(fit_errors(range_m, world, 2000).nees, 3.0) << range_m;
    EXPECT_GT(fit_errors(range_m, world, 2000, as_certain).nees, 20.0) << range_m;
  }
}

TEST(Reflectors, ABeamLostWithinOneDoesNotDivideIt) {
  Random random(2);
  const ReflectorWorld world = hall({1.0, 0.0});
  Points points = world.points(0.0, random);
  const auto middle = static_cast<std::size_t>(world.beams / 2 - 1);
  ASSERT_GT(points.points[middle].intensity, 700.0F);
  points.points[middle].state = BeamState::kFree;
  points.points[middle].intensity = kNoIntensity;
  const ReflectorSightings sightings = detect_reflectors(points, {});
  ASSERT_EQ(sightings.sightings.size(), 1U);
  EXPECT_LT((sightings.sightings[0].center_level_m - Eigen::Vector2d(1.0, 0.0)).norm(), 0.015);
}

TEST(Reflectors, WhatCannotBeOneIsRefusedWithItsReason) {
  Random random(3);
  const auto reason = [&](const ReflectorWorld& world, const ReflectorDetectionParams& params = {}) -> std::string {
    const ReflectorSightings sightings = seen(world, random, params);
    if (!sightings.sightings.empty() || sightings.refused.size() != 1U) return "none";
    return sightings.refused.begin()->first;
  };
  ReflectorWorld wall = hall({50.0, 0.0});
  wall.walls.push_back({{2.0, -0.4}, {2.0, 0.4}, 700.0});
  EXPECT_EQ(reason(wall), "wide");
  ReflectorWorld glossy;
  glossy.add_room({-3.0, -30.0}, {2.0, 30.0});
  glossy.walls[1].gloss = 400.0;  // the near one, square on
  EXPECT_EQ(reason(glossy), "flush");
  EXPECT_EQ(reason(hall({0.5, 0.0}, 0.005)), "narrow");
  EXPECT_EQ(reason(hall({0.25, 0.0}, 0.03)), "near");
  ReflectorDetectionParams short_sighted;
  short_sighted.max_range_m = 3.0;
  EXPECT_EQ(reason(hall({4.0, 0.0}), short_sighted), "far");
  EXPECT_EQ(reason(hall({2.0, 0.0}, 0.05, 440.0)), "dim");
  const double end_rad = radians(135.0);
  EXPECT_EQ(reason(hall({2.0 * std::cos(end_rad), 2.0 * std::sin(end_rad)})), "cut");
  EXPECT_EQ(seen(hall({2.0, 0.0}, 0.05, 400.0), random).sightings.size(), 0U);
}

// One side of it is hidden by something nearer: the azimuth is less certain and towards the visible side not wrong.
TEST(ReflectorFit, KnowsThatAHiddenSideIsHidden) {
  Random random(4);
  ReflectorWorld world = hall({2.0, 0.0});
  const ReflectorSightings open = seen(world, random);
  world.walls.push_back({{1.0, 0.002}, {1.0, 0.5}});  // hides the left half
  const ReflectorSightings half = seen(world, random);
  ASSERT_EQ(open.sightings.size(), 1U);
  ASSERT_EQ(half.sightings.size(), 1U);
  const ReflectorFit of_open = fit_reflector(open, open.sightings[0], 0.05);
  const ReflectorFit of_half = fit_reflector(half, half.sightings[0], 0.05);
  EXPECT_LT(std::abs(of_half.azimuth_rad), 3.5 * std::sqrt(of_half.covariance(1, 1)));
  EXPECT_GT(of_half.covariance(1, 1), 1.5 * of_open.covariance(1, 1));
}

// One that stands across the end of a full circle is one.
TEST(Reflectors, DoNotCareWhereAFullCircleBegins) {
  Random random(5);
  ReflectorWorld world = hall({-2.0, 0.0});
  world.angle_min_rad = -kPi;
  world.beams = 720;
  const ReflectorSightings sightings = seen(world, random);
  ASSERT_EQ(sightings.sightings.size(), 1U);
  EXPECT_LT((sightings.sightings[0].center_level_m - Eigen::Vector2d(-2.0, 0.0)).norm(), 0.03);
}

TEST(Reflectors, HaveTheTimeOfTheirMiddleBeam) {
  Random random(6);
  ReflectorWorld world = hall({2.0, 0.0});
  world.sweep_s = 0.03;
  EXPECT_NEAR(seen(world, random).sightings.at(0).time_offset_s, 0.015, 1e-4);
}

TEST(Reflectors, SurviveEmptyAndSingleScans) {
  EXPECT_TRUE(detect_reflectors({}, {}).sightings.empty());
  Random random(7);
  ReflectorWorld world = hall({2.0, 0.0});
  Points points = world.points(0.0, random);
  for (Point& point : points.points) point.intensity = kNoIntensity;
  EXPECT_TRUE(detect_reflectors(points, {}).sightings.empty());
  for (Point& point : points.points) point.intensity = 900.0F;  // all of them; the reflector still stands out
  EXPECT_LE(detect_reflectors(points, {}).sightings.size(), 1U);
  for (Point& point : points.points) point.state = BeamState::kInvalid;
  EXPECT_TRUE(detect_reflectors(points, {}).sightings.empty());
}

TEST(ReflectorDetectionParams, RefusalsNameFieldAndBound) {
  const auto refused = [](auto change) {
    ReflectorDetectionParams params;
    change(params);
    return refusal_of([&] { params.validate(); });
  };
  EXPECT_EQ(refused([](ReflectorDetectionParams&) {}), "");
  EXPECT_TRUE(names(refused([](auto& p) { p.radius_m = 2.0; }), {"reflectors.radius_m", "2", "1"}));
  EXPECT_TRUE(names(refused([](auto& p) { p.min_radius_m = 0.2; }), {"reflectors.min_radius_m", "max_radius_m"}));
  EXPECT_TRUE(names(refused([](auto& p) { p.min_range_m = 50.0; }), {"reflectors.min_range_m", "max_range_m"}));
  EXPECT_TRUE(
      names(refused([](auto& p) { p.min_intensity = 500.0; }), {"reflectors.min_intensity", "min_peak_intensity"}));
  ReflectorFitParams fit;
  fit.range_sigma_m = 0.0;
  EXPECT_TRUE(names(refusal_of([&] { fit.validate(); }), {"reflectors.fit.range_sigma_m", "0"}));
}

}  // namespace
}  // namespace situation_awareness::reflectors_test

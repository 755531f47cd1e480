// SPDX-License-Identifier: BSD-3-Clause
#include "situation_awareness/pose/standing_place.hpp"

#include <gtest/gtest.h>

#include <cmath>

#include "situation_awareness/common/random.hpp"
#include "situation_awareness/common/time.hpp"
#include "situation_awareness/geometry/angles.hpp"
#include "support/random_gaussian.hpp"

namespace situation_awareness::standing_place_test {
namespace {

constexpr double kSigma_m = 0.012;

/// Views from a quarter of a circle of 4 m about the place, 25 a second, of a cylinder whose radius is taken to be
/// smaller than it is by `too_small_m`, and which moves.
StandingPlace viewed(Random& random, double too_small_m, const Eigen::Vector2d& velocity_m_s = Eigen::Vector2d::Zero(),
                     double turn_rad = 0.5 * kPi) {
  StandingPlace place;
  const Eigen::Vector2d center_m(2.0, -3.0);
  for (int i = 0; i < 300; ++i) {
    const double angle_rad = 0.3 + turn_rad * i / 300.0;
    const Eigen::Vector2d to(std::cos(angle_rad), std::sin(angle_rad));
    const Eigen::Vector2d seen_m =
        center_m + 0.04 * i * velocity_m_s + too_small_m * to + kSigma_m * normal_vector<2>(random);
    place.add(nanoseconds(10.0 + 0.04 * i), seen_m, kSigma_m * kSigma_m * Eigen::Matrix2d::Identity(),
              center_m + 4.0 * to);
  }
  return place;
}

TEST(StandingPlace, AReflectorThatStandsIsOneWhereItStands) {
  Random random(1);
  int accepted = 0;
  for (int seed = 0; seed < 100; ++seed) {
    const StandingPlace place = viewed(random, 0.0);
    accepted += place.is_reflector() ? 1 : 0;
    EXPECT_NEAR(place.seen_s(), 299 * 0.04, 1e-6);
    EXPECT_LT((place.center_world_m() - Eigen::Vector2d(2.0, -3.0)).norm(), 0.01);
  }
  EXPECT_GE(accepted, 98);  // of 99.7 % within three standard deviations
}

TEST(StandingPlace, WhatIsThickerOrThinnerIsNone) {
  Random random(2);
  for (int seed = 0; seed < 100; ++seed) {
    EXPECT_FALSE(viewed(random, 0.1).is_reflector());
    EXPECT_FALSE(viewed(random, -0.04).is_reflector());
  }
}

TEST(StandingPlace, WhatMovesIsNone) {
  Random random(3);
  for (int seed = 0; seed < 100; ++seed) EXPECT_FALSE(viewed(random, 0.0, {0.02, 0.01}).is_reflector());
}

TEST(StandingPlace, ViewsFromOneSideDoNotTell) {
  Random random(4);
  for (int seed = 0; seed < 100; ++seed) {
    EXPECT_FALSE(viewed(random, 0.0, {0.0, 0.0}, 0.0).is_reflector());
    EXPECT_FALSE(viewed(random, 0.0, {0.0, 0.0}, radians(5.0)).is_reflector());
  }
}

TEST(StandingPlace, TimeOutOfViewDoesNotCount) {
  StandingPlace place;
  EXPECT_EQ(place.seen_s(), 0.0);
  for (const double time_s : {1.0, 1.1, 1.2, 31.2, 31.3}) {
    place.add(nanoseconds(time_s), {1.0, 0.0}, Eigen::Matrix2d::Identity(), {0.0, 0.0});
  }
  EXPECT_NEAR(place.seen_s(), 0.3, 1e-6);
}

}  // namespace
}  // namespace situation_awareness::standing_place_test

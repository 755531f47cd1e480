// SPDX-License-Identifier: BSD-3-Clause
#include "situation_awareness/map/polygons/chain_state.hpp"

#include <cmath>
#include <cstdint>
#include <stdexcept>

#include <gtest/gtest.h>

#include "situation_awareness/geometry/angles.hpp"
#include "situation_awareness/geometry/pose2.hpp"

namespace situation_awareness::chain_state_test {
namespace {

constexpr std::int64_t kSecond_ns = 1'000'000'000;
constexpr std::int64_t kNow_ns = 5000 * kSecond_ns;

/// Along a quarter of a circle, first seen so long ago.
Chain a_chain(double extent_m, double age_s, double p_exists = 0.99) {
  Chain chain{7, false, {}, kNow_ns - static_cast<std::int64_t>(age_s * 1e9), kNow_ns, p_exists};
  for (int i = 0; i <= 4; ++i) {
    const double angle_rad = 0.1 * kPi * i;
    const double radius_m = extent_m / (2.0 * std::sin(0.2 * kPi));
    chain.vertices.push_back({{radius_m * std::cos(angle_rad), radius_m * std::sin(angle_rad)}, 0.01});
  }
  return chain;
}

TEST(ChainState, IsThatOfItsRules) {
  const ChainStateParams params;
  const std::int64_t transit_ns = kNow_ns - 10 * kSecond_ns;
  EXPECT_EQ(state_of(a_chain(1.0, 1.0), kNow_ns, transit_ns, params), ChainState::kNew);
  EXPECT_EQ(state_of(a_chain(5.0, 1.0), kNow_ns, transit_ns, params), ChainState::kNew);
  EXPECT_EQ(state_of(a_chain(1.0, 11.0), kNow_ns, transit_ns, params), ChainState::kKnown) << "of a transit before";
  EXPECT_EQ(state_of(a_chain(5.0, 11.0), kNow_ns, transit_ns, params), ChainState::kWall);
  EXPECT_EQ(state_of(a_chain(1.0, 61.0), kNow_ns, kNow_ns - 100 * kSecond_ns, params), ChainState::kKnown)
      << "there for long";
  EXPECT_EQ(state_of(a_chain(1.0, 59.0), kNow_ns, kNow_ns - 100 * kSecond_ns, params), ChainState::kNew);
  for (const double extent_m : {1.0, 5.0}) {
    for (const double age_s : {1.0, 1000.0}) {
      EXPECT_EQ(state_of(a_chain(extent_m, age_s, 0.74), kNow_ns, transit_ns, params), ChainState::kDoubted);
    }
  }
}

TEST(ChainState, TheExtentIsTheLargestDistance) {
  for (const double m : {0.1, 1.59, 1.61, 30.0}) {
    EXPECT_NEAR(extent_m(a_chain(m, 1.0)), m, 1e-12 * m + 1e-12);
    EXPECT_EQ(extent_m(a_chain(m, 1.0), 1.6) > 1.6, m > 1.6);
  }
  EXPECT_EQ(extent_m(Chain{}), 0.0);
}

TEST(ChainState, RigidMotionAndAShiftOfTimeChangeNothing) {
  const Pose2 T{{-310.0, 47.0}, 2.1};
  for (const double extent : {0.4, 1.5, 1.7, 12.0}) {
    for (const double age_s : {0.0, 5.0, 30.0, 100.0}) {
      for (const double p : {0.5, 0.95}) {
        const Chain chain = a_chain(extent, age_s, p);
        Chain moved = chain;
        for (ChainVertex& vertex : moved.vertices) vertex.p_world_m = T * vertex.p_world_m;
        const std::int64_t later_ns = 123'456'789'012;
        moved.first_seen_ns += later_ns;
        moved.last_seen_ns += later_ns;
        const std::int64_t transit_ns = kNow_ns - 20 * kSecond_ns;
        EXPECT_EQ(state_of(chain, kNow_ns, transit_ns, {}),
                  state_of(moved, kNow_ns + later_ns, transit_ns + later_ns, {}));
      }
    }
  }
}

TEST(ChainState, RefusesParametersOutOfBounds) {
  ChainStateParams params;
  EXPECT_NO_THROW(params.validate());
  params.doubted_p = 0.4;
  EXPECT_THROW(params.validate(), std::invalid_argument);
}

}  // namespace
}  // namespace situation_awareness::chain_state_test

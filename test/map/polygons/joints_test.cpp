// SPDX-License-Identifier: BSD-3-Clause
#include "situation_awareness/map/polygons/joints.hpp"

#include <cstdint>
#include <vector>

#include <gtest/gtest.h>

#include "situation_awareness/common/random.hpp"

namespace situation_awareness::joints_test {
namespace {

constexpr double kStep_s = 0.04;

/// Scans in which chains 1 and 2 meet with this probability, and how often the decision changed.
int changes_of(Joints& joints, double share, double duration_s, std::uint64_t seed) {
  Random random(seed);
  int changes = 0;
  for (double t = 0.0; t < duration_s; t += kStep_s) {
    const bool before = joints.are_joined(1, 2, false);
    joints.see(2, 1, random.uniform(0.0, 1.0) < share);
    joints.decide(kStep_s);
    changes += joints.are_joined(1, 2, false) != before ? 1 : 0;
  }
  return changes;
}

TEST(Joints, WhatIsNotKnownIsAsTheElementsSay) {
  const Joints joints;
  EXPECT_TRUE(joints.are_joined(3, 1, true));
  EXPECT_FALSE(joints.are_joined(3, 1, false));
  EXPECT_FALSE(joints.is_firm(1, 3));
}

TEST(Joints, DecidesByTheShareOfTheTimeAndInEitherOrder) {
  for (const double share : {0.05, 0.9}) {
    Joints joints;
    changes_of(joints, share, 10.0, 1);
    for (const bool meet : {false, true}) {
      EXPECT_EQ(joints.are_joined(1, 2, meet), share > 0.5);
      EXPECT_EQ(joints.are_joined(2, 1, meet), share > 0.5);
    }
    EXPECT_EQ(joints.is_firm(1, 2), share > 0.5);
  }
}

TEST(Joints, DoesNotFollowSingleScans) {
  for (std::uint64_t seed = 0; seed < 20; ++seed) {
    Joints joints;
    changes_of(joints, 0.5, 4.0, seed);
    EXPECT_LE(changes_of(joints, 0.5, 60.0, 100 + seed), 1) << seed;
  }
}

TEST(Joints, FollowsWhatHasChangedForLong) {
  Joints joints;
  changes_of(joints, 1.0, 30.0, 2);
  EXPECT_TRUE(joints.are_joined(1, 2, false));
  changes_of(joints, 0.0, 40.0, 3);
  EXPECT_FALSE(joints.are_joined(1, 2, true));
  EXPECT_FALSE(joints.is_firm(1, 2));
}

TEST(Joints, ForgetsWhatIsGone) {
  Joints joints;
  joints.see(7, 5, true);
  joints.see(1, 5, true);
  joints.see(1, 9, true);
  joints.decide(kStep_s);
  joints.forget({7, 9});
  EXPECT_TRUE(joints.are_joined(5, 1, false));
  EXPECT_FALSE(joints.are_joined(7, 5, false));
  EXPECT_FALSE(joints.are_joined(1, 9, false));
}

}  // namespace
}  // namespace situation_awareness::joints_test

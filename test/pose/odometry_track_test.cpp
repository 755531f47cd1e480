// SPDX-License-Identifier: BSD-3-Clause
#include "situation_awareness/pose/odometry_track.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <limits>

#include "situation_awareness/common/time.hpp"
#include "situation_awareness/estimation/manifold.hpp"
#include "situation_awareness/geometry/lie_groups.hpp"
#include "support/refusal.hpp"

namespace situation_awareness::odometry_track_test {
namespace {

constexpr std::int64_t kStep_ns = 20'000'000;

/// On a circle at a constant velocity.
Pose2 at_s(double time_s) { return exp_se2(time_s * Eigen::Vector3d(0.8, 0.0, 0.6)); }

double distance(const Pose2& a, const Pose2& b) { return Manifold<Pose2>::local_coordinates(a, b).norm(); }

OdometryTrack track_of(int poses) {
  OdometryTrack track({});
  for (int i = 0; i < poses; ++i) track.add(i * kStep_ns, at_s(0.02 * i));
  return track;
}

TEST(OdometryTrack, InterpolatesAndExtrapolatesAlongArcs) {
  const OdometryTrack track = track_of(50);
  OdometryTrack::Entry entry;
  for (const double time_s : {0.0, 0.013, 0.5, 0.98, 1.0, 1.1}) {
    ASSERT_TRUE(track.at(nanoseconds(time_s), entry)) << time_s;
    EXPECT_LT(distance(entry.T_track_base, at_s(time_s)), 1e-9) << time_s;
    EXPECT_EQ(entry.stamp_ns, nanoseconds(time_s));
  }
  EXPECT_FALSE(track.at(-1, entry));
  EXPECT_FALSE(track.at(nanoseconds(0.98 + 0.151), entry));
  EXPECT_FALSE(OdometryTrack({}).at(0, entry));
}

TEST(OdometryTrack, KeepsTheLatestPoses) {
  const OdometryTrack track = track_of(2000);
  EXPECT_EQ(track.size(), OdometryTrack::kCapacity);
  OdometryTrack::Entry entry;
  EXPECT_TRUE(track.at(1999 * kStep_ns, entry));
  EXPECT_TRUE(track.at((2000 - 512) * kStep_ns, entry));
  EXPECT_LT(distance(entry.T_track_base, at_s(0.02 * (2000 - 512))), 1e-6);
  EXPECT_FALSE(track.at((2000 - 513) * kStep_ns, entry));
}

TEST(OdometryTrack, CountsAndRefusesWhatIsOutOfOrderOrNotFinite) {
  OdometryTrack track = track_of(10);
  EXPECT_EQ(track.add(9 * kStep_ns, at_s(5.0)), OdometryTrack::Verdict::kRefused);
  EXPECT_EQ(track.add(8 * kStep_ns, at_s(5.0)), OdometryTrack::Verdict::kRefused);
  EXPECT_EQ(track.add(10 * kStep_ns, {{std::nan(""), 0.0}, 0.0}), OdometryTrack::Verdict::kRefused);
  EXPECT_EQ(track.counters(),
            (Counters{{"odometry stamped twice", 1}, {"odometry out of order", 1}, {"odometry not finite", 1}}));
  EXPECT_EQ(track.size(), 10U);
}

// The motion goes on as before, and later motions are as given.
TEST(OdometryTrack, ReplacesAJumpByTheMotionBeforeIt) {
  OdometryTrack track = track_of(10);
  const Pose2 jump{{7.0, -3.0}, 1.0};
  for (int i = 10; i < 20; ++i) track.add(i * kStep_ns, jump * at_s(0.02 * i));
  EXPECT_EQ(track.counters().of("odometry jumped"), 1U);
  EXPECT_LT(distance(track.latest().T_track_base, at_s(0.02 * 19)), 1e-9);
  EXPECT_EQ(track.latest().jumps, 1);
  EXPECT_EQ(track[5].jumps, 0);
}

TEST(OdometryTrack, StartsAnewAfterAJumpBackInTime) {
  OdometryTrack track = track_of(200);
  EXPECT_EQ(track.add(0, at_s(1.0)), OdometryTrack::Verdict::kRefused);
  EXPECT_EQ(track.add(kStep_ns, at_s(1.02)), OdometryTrack::Verdict::kRefused);
  EXPECT_EQ(track.size(), 200U);
  EXPECT_EQ(track.counters().of("odometry of another time"), 2U);
  EXPECT_EQ(track.add(2 * kStep_ns, at_s(1.04)), OdometryTrack::Verdict::kRestarted);
  EXPECT_EQ(track.size(), 1U);
  EXPECT_EQ(track.counters().of("odometry restarted"), 1U);
}

TEST(OdometryTrack, RefusesParamsNamingThem) {
  OdometryTrackParams params;
  params.max_speed_m_s = 0.0;
  EXPECT_TRUE(names(refusal_of([&] { OdometryTrack track(params); }), {"odometry.max_speed_m_s", "0"}));
}

}  // namespace
}  // namespace situation_awareness::odometry_track_test

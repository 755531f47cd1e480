// SPDX-License-Identifier: BSD-3-Clause
#include "situation_awareness/geometry/biarc.hpp"

#include <gtest/gtest.h>

#include <cmath>

#include "situation_awareness/common/random.hpp"

namespace situation_awareness::biarc_test {
namespace {

/// The pose after an arc from a pose.
Pose2 after_arc(const Pose2& from, double curvature_1pm, double sweep_rad) {
  const auto unit = [](double yaw_rad) -> Eigen::Vector2d { return {std::cos(yaw_rad), std::sin(yaw_rad)}; };
  const double chord_m = 2.0 * std::sin(0.5 * sweep_rad) / curvature_1pm;
  return {from.translation_m + chord_m * unit(from.yaw_rad + 0.5 * sweep_rad), from.yaw_rad + sweep_rad};
}

Pose2 random_pose(Random& random) {
  return {{random.uniform(-5.0, 5.0), random.uniform(-5.0, 5.0)}, random.uniform(-10.0, 10.0)};
}

TEST(Biarc, LeadsFromPoseToPoseAndSharesTheTangent) {
  Random random(1);
  for (int i = 0; i < 5000; ++i) {
    const Pose2 from = random_pose(random), to = random_pose(random);
    const Biarc biarc = equal_chord_biarc(from, to);
    const Eigen::Vector2d chord0_m = biarc.joint.translation_m - from.translation_m;
    const Eigen::Vector2d chord1_m = to.translation_m - biarc.joint.translation_m;
    const double tolerance = 1e-12 * (1.0 + biarc.chord_m);
    EXPECT_NEAR(chord0_m.norm(), biarc.chord_m, tolerance);
    EXPECT_NEAR(chord1_m.norm(), biarc.chord_m, tolerance);
    // A chord bisects the tangents at its ends.
    EXPECT_NEAR(wrap_to_pi(std::atan2(chord0_m.y(), chord0_m.x()) - from.yaw_rad - 0.5 * biarc.sweep0_rad), 0.0, 1e-12);
    EXPECT_NEAR(wrap_to_pi(std::atan2(chord1_m.y(), chord1_m.x()) - to.yaw_rad + 0.5 * biarc.sweep1_rad), 0.0, 1e-12);
    EXPECT_NEAR(wrap_to_pi(from.yaw_rad + biarc.sweep0_rad - biarc.joint.yaw_rad), 0.0, 1e-12);
    EXPECT_NEAR(wrap_to_pi(biarc.joint.yaw_rad + biarc.sweep1_rad - to.yaw_rad), 0.0, 1e-12);
  }
}

TEST(Biarc, ItsCurvaturesLeadThere) {
  Random random(2);
  for (int i = 0; i < 5000; ++i) {
    const Pose2 from = random_pose(random), to = random_pose(random);
    const Biarc biarc = equal_chord_biarc(from, to);
    if (std::min(std::abs(biarc.curvature0_1pm), std::abs(biarc.curvature1_1pm)) < 1e-6) continue;
    const Pose2 joint = after_arc(from, biarc.curvature0_1pm, biarc.sweep0_rad);
    const Pose2 end = after_arc(joint, biarc.curvature1_1pm, biarc.sweep1_rad);
    EXPECT_LT((joint.translation_m - biarc.joint.translation_m).norm(), 1e-12 * (1.0 + biarc.chord_m));
    EXPECT_LT((end.translation_m - to.translation_m).norm(), 1e-12 * (1.0 + biarc.chord_m));
  }
}

TEST(Biarc, IsTheCircleAndTheLine) {
  Random random(3);
  for (int i = 0; i < 1000; ++i) {
    const Pose2 from = random_pose(random);
    const double curvature_1pm = random.uniform(0.1, 2.0);
    const Biarc circle = equal_chord_biarc(from, after_arc(from, curvature_1pm, random.uniform(0.1, 3.0)));
    EXPECT_NEAR(circle.curvature0_1pm, curvature_1pm, 1e-11);
    EXPECT_NEAR(circle.curvature1_1pm, curvature_1pm, 1e-11);
  }
  const Biarc line = equal_chord_biarc({{1.0, 2.0}, 0.0}, {{5.0, 2.0}, 0.0});
  EXPECT_EQ(line.curvature0_1pm, 0.0);
  EXPECT_EQ(line.curvature1_1pm, 0.0);
  EXPECT_EQ(line.joint.translation_m, Eigen::Vector2d(3.0, 2.0));
}

TEST(Biarc, OfParallelTangentsIsSymmetric) {
  const Biarc biarc = equal_chord_biarc({{0.0, 0.0}, 0.0}, {{4.0, 1.0}, 0.0});
  EXPECT_NEAR(biarc.curvature0_1pm, -biarc.curvature1_1pm, 1e-15);
  EXPECT_GT(biarc.curvature0_1pm, 0.0);
  EXPECT_LT((biarc.joint.translation_m - Eigen::Vector2d(2.0, 0.5)).norm(), 1e-15);
}

TEST(Biarc, BackwardsIsTheSame) {
  Random random(4);
  for (int i = 0; i < 1000; ++i) {
    const Pose2 from = random_pose(random), to = random_pose(random);
    const Biarc there = equal_chord_biarc(from, to);
    const Biarc back =
        equal_chord_biarc({to.translation_m, to.yaw_rad + kPi}, {from.translation_m, from.yaw_rad + kPi});
    const double tolerance = 1e-11 * (1.0 + there.chord_m);
    // The heading is wrapped at a half turn: a biarc that turns by more is another one backwards.
    if ((there.joint.translation_m - back.joint.translation_m).norm() > 1e-3) {
      const Eigen::Vector2d chord = to.translation_m - from.translation_m;
      const double yaw_rad = std::atan2(chord.y(), chord.x());
      EXPECT_NEAR(std::max(std::abs(wrap_to_pi(from.yaw_rad - yaw_rad)), std::abs(wrap_to_pi(to.yaw_rad - yaw_rad))),
                  kPi, 1e-9);
      continue;
    }
    EXPECT_NEAR(there.curvature0_1pm, -back.curvature1_1pm, tolerance);
    EXPECT_NEAR(there.curvature1_1pm, -back.curvature0_1pm, tolerance);
  }
}

}  // namespace
}  // namespace situation_awareness::biarc_test

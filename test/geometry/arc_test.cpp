// SPDX-License-Identifier: BSD-3-Clause
#include "situation_awareness/geometry/arc.hpp"

#include <gtest/gtest.h>

#include <cmath>

#include "situation_awareness/common/random.hpp"

namespace situation_awareness::arc_test {
namespace {

TEST(Arc, AHalfCircleHasBulgeOne) {
  const Arc arc = arc_with_bulge({1.0, 0.0}, {3.0, 0.0}, 1.0);
  EXPECT_LT((arc.center_m - Eigen::Vector2d(2.0, 0.0)).norm(), 1e-15);
  EXPECT_NEAR(arc.radius_m, 1.0, 1e-15);
  EXPECT_NEAR(pose_at(arc, 0.5 * kPi).translation_m.y(), -1.0, 1e-15);  // counter-clockwise: below the chord
  EXPECT_NEAR(arc_with_bulge({1.0, 0.0}, {3.0, 0.0}, -1.0).sweep_rad, -kPi, 1e-15);
}

TEST(Arc, LeadsFromPointToPointAndHasItsBulge) {
  Random random(1);
  for (int i = 0; i < 10'000; ++i) {
    const Eigen::Vector2d from(random.normal(), random.normal()), to(random.normal(), random.normal());
    const double given = (random.uniform() < 0.5 ? -1.0 : 1.0) * std::exp(random.uniform(-4.0, 3.0));
    const Arc arc = arc_with_bulge(from, to, given);
    const double tolerance = 1e-13 * (1.0 + arc.radius_m);
    EXPECT_LT((pose_at(arc, 0.0).translation_m - from).norm(), tolerance);
    EXPECT_LT((pose_at(arc, length_m(arc)).translation_m - to).norm(), tolerance);
    EXPECT_NEAR(bulge(arc), given, 1e-13 * std::abs(given) * (1.0 + std::abs(given)));
    // The height of the arc over half its chord, to the right of the chord if counter-clockwise.
    const Eigen::Vector2d chord = to - from;
    const Eigen::Vector2d top = pose_at(arc, 0.5 * length_m(arc)).translation_m - 0.5 * (from + to);
    EXPECT_NEAR(top.x() * chord.y() - top.y() * chord.x(), 0.5 * given * chord.squaredNorm(), 10.0 * tolerance);
  }
}

TEST(Arc, HeadsAlongItsWay) {
  Random random(2);
  for (int i = 0; i < 1000; ++i) {
    const Arc arc{{random.normal(), random.normal()},
                  random.uniform(0.1, 5.0),
                  random.uniform(-9.0, 9.0),
                  random.uniform(-6.0, 6.0)};
    const double way_m = random.uniform() * length_m(arc);
    constexpr double kStep_m = 1e-5;
    const Eigen::Vector2d step =
        pose_at(arc, way_m + kStep_m).translation_m - pose_at(arc, way_m - kStep_m).translation_m;
    EXPECT_NEAR(step.norm(), 2.0 * kStep_m, 1e-9);
    EXPECT_NEAR(wrap_to_pi(std::atan2(step.y(), step.x()) - pose_at(arc, way_m).yaw_rad), 0.0, 1e-8);
  }
}

}  // namespace
}  // namespace situation_awareness::arc_test

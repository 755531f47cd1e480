// SPDX-License-Identifier: BSD-3-Clause
#include "situation_awareness/evaluation/bodies.hpp"

#include <cmath>

#include <gtest/gtest.h>

#include "situation_awareness/geometry/angles.hpp"

namespace situation_awareness::bodies_test {
namespace {

TEST(Bodies, AreObjectsOfTheSameNameBeforeTheSlash) {
  const std::vector<Body> bodies = bodies_of({"a/arm", "post", "b/arm", "a/torso", "a"});
  ASSERT_EQ(bodies.size(), 4U);
  EXPECT_EQ(bodies[0].name, "a");
  EXPECT_EQ(bodies[0].parts, (std::vector<std::size_t>{0, 3}));
  EXPECT_EQ(bodies[1].name, "post");
  EXPECT_EQ(bodies[2].parts, std::vector<std::size_t>{2});
  EXPECT_EQ(bodies[3].parts, std::vector<std::size_t>{4}) << "an object of a body's name is not a part of it";
}

TEST(WithinReach, IsTheHullOfDiscsGrownByTheMargin) {
  // Two discs: their hull is a stadium, the points within r + margin of the line between the centres.
  const std::vector<Ellipse> discs = {{{0, 0}, 0.0, 0.2, 0.2}, {{1, 1}, 0.7, 0.2, 0.2}};
  for (const double angle : {0.0, 0.8, 1.9, 3.1, 4.4, 5.9}) {
    const Eigen::Vector2d n(std::cos(angle), std::sin(angle));
    for (const double distance : {0.298, 0.302}) {
      const bool inside = distance < 0.3;
      const Eigen::Vector2d end_m = n.sum() > 0.0 ? Eigen::Vector2d(1, 1) : Eigen::Vector2d(0, 0);
      EXPECT_EQ(within_reach(discs, end_m + distance * n, 0.1), inside) << angle;
    }
  }
  const Eigen::Vector2d across = Eigen::Vector2d(1, -1).normalized();
  EXPECT_TRUE(within_reach(discs, Eigen::Vector2d(0.5, 0.5) + 0.298 * across, 0.1));
  EXPECT_FALSE(within_reach(discs, Eigen::Vector2d(0.5, 0.5) + 0.302 * across, 0.1));
}

TEST(WithinReach, OfOneEllipseWithoutMarginIsTheEllipse) {
  const Ellipse ellipse{{1, -2}, 0.6, 0.5, 0.2};
  for (int i = 0; i < 60; ++i) {
    const double angle = 2.0 * kPi * i / 60;
    const Eigen::Vector2d spoke =
        Eigen::Rotation2Dd(0.6) * Eigen::Vector2d(0.5 * std::cos(angle), 0.2 * std::sin(angle));
    EXPECT_TRUE(within_reach({ellipse}, ellipse.center_m + 0.999 * spoke, 0.0)) << i;
    EXPECT_FALSE(within_reach({ellipse}, ellipse.center_m + 1.001 * spoke, 0.0)) << i;
  }
}

/// A scan of segments that are runs of beams, one after the other.
Segments segments_of(const std::vector<int>& lengths) {
  Segments segments;
  for (const int length : lengths) {
    segments.segments.push_back({segments.points.size(), static_cast<std::size_t>(length)});
    for (int i = 0; i < length; ++i) {
      Point point;
      point.beam = static_cast<int>(segments.points.size());
      segments.points.push_back(point);
    }
  }
  return segments;
}

TEST(SeparateParts, HaveSeparateSegments) {
  const Body body{"person", {1, 2, 3}};
  // [1 1 1 1 1] [2 2 2 2 2] [3 3 3 3]: all apart.
  EXPECT_EQ(separate_parts(body, segments_of({5, 5, 4}), {1, 1, 1, 1, 1, 2, 2, 2, 2, 2, 3, 3, 3, 3}, 4), 3);
  // One segment over all of them, most of it the first's.
  EXPECT_EQ(separate_parts(body, segments_of({14}), {1, 1, 1, 1, 1, 1, 2, 2, 2, 2, 3, 3, 3, 3}, 4), 1);
  // Two segments of the same part, one of another object, one too short, one that is mostly noise.
  EXPECT_EQ(separate_parts(body, segments_of({4, 4, 4, 3, 7}),
                           {1, 1, 1, 1, 1, 1, 1, 1, 0, 0, 0, 0, 2, 2, 2, -1, -1, -1, -1, 3, 3, 3}, 4),
            1);
}

}  // namespace
}  // namespace situation_awareness::bodies_test

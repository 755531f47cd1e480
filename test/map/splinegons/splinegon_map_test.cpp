// SPDX-License-Identifier: BSD-3-Clause
#include "situation_awareness/map/splinegons/splinegon_map.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <utility>
#include <vector>

#include "map/splinegons/outlines.hpp"

namespace situation_awareness::splinegon_map_test {
namespace {

SplinegonMap make_map() { return {SplinegonMapParams(), SplinegonFitParams()}; }

ObstacleBoundary boundary_of(std::vector<SplinegonElement> elements, bool closed, std::int64_t stamp_ns) {
  ObstacleBoundary boundary;
  boundary.id = 7;
  boundary.closed = closed;
  boundary.elements = std::move(elements);
  boundary.last_seen_ns = stamp_ns;
  return boundary;
}

/// Around a circle of 5 m by so many turns, 0.15 m apart, each turn so much farther out than the one before.
std::vector<SplinegonElement> spiral(double turns, double growth_m) {
  std::vector<SplinegonElement> elements;
  for (double phi = 0.0; phi < 2.0 * kPi * turns; phi += 0.03) {
    const Eigen::Vector2d u(std::cos(phi), std::sin(phi));
    elements.push_back({(5.0 + growth_m * phi / (2.0 * kPi)) * u, u, 1e-4});
  }
  return elements;
}

/// An eight: it crosses itself in the middle.
std::vector<SplinegonElement> eight() {
  std::vector<SplinegonElement> elements;
  for (double phi = 0.8; phi < 2.0 * kPi + 0.8; phi += 0.02) {
    const Eigen::Vector2d along = Eigen::Vector2d(6.0 * std::cos(phi), 6.0 * std::cos(2.0 * phi)).normalized();
    elements.push_back({{6.0 * std::sin(phi), 3.0 * std::sin(2.0 * phi)}, {along.y(), -along.x()}, 1e-4});
  }
  return elements;
}

// It does not vanish, either: an open part of it is given.
TEST(SplinegonMap, GivesNoBoundaryThatCrossesItself) {
  for (const bool closed : {false, true}) {
    SplinegonMap map = make_map();
    const Splinegons& splinegons = map.update(1, {boundary_of(eight(), closed, 1)});
    ASSERT_EQ(splinegons.boundaries.size(), 1U);
    EXPECT_TRUE(is_simple(splinegons.boundaries[0]));
    EXPECT_FALSE(splinegons.boundaries[0].closed);
    EXPECT_GT(length_m(splinegons.boundaries[0]), 10.0);  // of 30 m
    EXPECT_EQ(map.polygons(), 1U);
    EXPECT_EQ(map.update(2, {boundary_of(eight(), closed, 1)}).boundaries.size(), 1U);
    EXPECT_EQ(map.polygons() + map.kept(), 1U);
  }
}

TEST(SplinegonMap, KeepsTheLastBoundaryThatDoesNotCrossItself) {
  SplinegonMap map = make_map();
  const Splinegons before = map.update(1, {boundary_of(spiral(0.9, 0.0), false, 1)});
  ASSERT_EQ(before.boundaries.size(), 1U);
  ASSERT_TRUE(is_simple(before.boundaries[0]));
  for (const bool closed : {false, true}) {
    const Splinegons& after = map.update(2, {boundary_of(eight(), closed, 2)});
    ASSERT_EQ(after.boundaries.size(), 1U);
    EXPECT_EQ(after.boundaries[0].id, 7U);
    EXPECT_FALSE(after.boundaries[0].closed);
    EXPECT_EQ(after.boundaries[0].last_seen_ns, 1);  // what has been seen since is not in it
    EXPECT_EQ(map.update(3, {boundary_of(eight(), closed, 2)}).boundaries[0].last_seen_ns, 1);
    ASSERT_EQ(after.boundaries[0].vertices.size(), before.boundaries[0].vertices.size());
    for (std::size_t i = 0; i < before.boundaries[0].vertices.size(); ++i) {
      EXPECT_EQ(after.boundaries[0].vertices[i].p_world_m, before.boundaries[0].vertices[i].p_world_m);
    }
  }
  // And goes on from there as soon as the elements allow it.
  const Splinegons& again = map.update(4, {boundary_of(spiral(1.0, 0.0), true, 4)});
  ASSERT_EQ(again.boundaries.size(), 1U);
  EXPECT_TRUE(again.boundaries[0].closed);
  EXPECT_NEAR(area_m2(again.boundaries[0]), 25.0 * kPi, 0.1);
}

TEST(SplinegonMap, FollowsElementsThatMoved) {
  SplinegonMap map = make_map();
  ObstacleBoundary boundary = boundary_of(spiral(1.0, 0.0), true, 1);
  map.update(1, {boundary});
  for (SplinegonElement& element : boundary.elements) element.p_world_m.x() += 0.3;
  EXPECT_LT(distance_m(map.update(2, {boundary}).boundaries[0], {5.0, 0.0}), 0.01);  // nobody hit it
  boundary.moved = true;
  EXPECT_LT(distance_m(map.update(3, {boundary}).boundaries[0], {5.3, 0.0}), 0.01);
}

// Nobody can have seen it there. What is before a boundary is another thing.
TEST(SplinegonMap, LeavesOutWhatIsWithinAClosedBoundary) {
  for (const double radius_m : {4.8, 5.05, 5.3}) {
    ObstacleBoundary arc = boundary_of(spiral(0.2, 0.0), false, 1);
    arc.id = 8;
    for (SplinegonElement& element : arc.elements) element.p_world_m *= radius_m / 5.0;
    const std::size_t expected = radius_m < 5.1 ? 1 : 2;
    for (const bool first : {false, true}) {
      SplinegonMap map = make_map();
      std::vector<ObstacleBoundary> boundaries = {boundary_of(spiral(1.0, 0.0), true, 1), arc};
      if (first) std::swap(boundaries[0], boundaries[1]);
      const Splinegons& splinegons = map.update(1, boundaries);
      ASSERT_EQ(splinegons.boundaries.size(), expected) << radius_m;
      EXPECT_EQ(splinegons.boundaries[0].id, 7U);
      // What is before it now may be going to move.
      ObstacleBoundary& moving = boundaries[first ? 0 : 1];
      moving.motion.translation_m = Eigen::Vector2d(-0.2, -0.2);
      EXPECT_EQ(map.update(1, boundaries).boundaries.size(), 1U) << radius_m;
      moving.motion = {};
      boundaries[first ? 1 : 0].closed = false;  // then it is none's inside
      EXPECT_EQ(map.update(2, boundaries).boundaries.size(), 2U) << radius_m;
    }
  }
}

TEST(SplinegonMap, OnesThatRunClockwiseAreNotClosed) {
  std::vector<SplinegonElement> elements = spiral(1.0, 0.0);
  std::reverse(elements.begin(), elements.end());
  SplinegonMap map = make_map();
  const Splinegons& splinegons = map.update(1, {boundary_of(elements, true, 1)});
  ASSERT_EQ(splinegons.boundaries.size(), 1U);
  EXPECT_FALSE(splinegons.boundaries[0].closed);
}

// Whatever the elements are, what is given is no longer than they ask for, does not cross itself, and is finite.
TEST(SplinegonMap, GivesSoundBoundariesOfAnyElements) {
  Random random(3);
  std::size_t given = 0;
  SplinegonMap map = make_map();
  for (int trial = 1; trial <= 300; ++trial) {
    std::vector<SplinegonElement> elements;
    Eigen::Vector2d p_m(random.uniform(-5.0, 5.0), random.uniform(-5.0, 5.0));
    double yaw = random.uniform(-kPi, kPi), turn = 0.0, way_m = 0.0;
    const int count = static_cast<int>(random.uniform(6.0, 200.0));
    for (int i = 0; i < count; ++i) {
      turn += 0.1 * random.normal();
      yaw += 0.15 * turn;
      if (random.uniform() < 0.02) yaw += random.uniform(-3.0, 3.0);
      const double step_m = random.uniform() < 0.02 ? random.uniform(0.2, 3.0) : 0.15;
      p_m += step_m * Eigen::Vector2d(std::cos(yaw), std::sin(yaw));
      elements.push_back(
          {p_m + 0.05 * Eigen::Vector2d(random.normal(), random.normal()), {std::sin(yaw), -std::cos(yaw)}, 1e-3});
      if (i > 0) way_m += (elements[elements.size() - 1].p_world_m - elements[elements.size() - 2].p_world_m).norm();
    }
    ObstacleBoundary boundary = boundary_of(elements, trial % 3 == 0, trial);
    boundary.id = static_cast<std::uint64_t>(trial);
    for (const Splinegon& splinegon : map.update(trial, {boundary}).boundaries) {
      ++given;
      EXPECT_TRUE(is_simple(splinegon)) << trial;
      EXPECT_LT(length_m(splinegon), 1.51 * (way_m + (elements.back().p_world_m - elements.front().p_world_m).norm()))
          << trial;
      EXPECT_TRUE(!splinegon.closed || area_m2(splinegon) > 0.0) << trial;
    }
  }
  EXPECT_GT(given, 50U);
}

}  // namespace
}  // namespace situation_awareness::splinegon_map_test

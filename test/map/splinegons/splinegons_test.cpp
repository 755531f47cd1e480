// SPDX-License-Identifier: BSD-3-Clause
#include "situation_awareness/map/splinegons/splinegons.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <tuple>

#include "situation_awareness/common/random.hpp"
#include "situation_awareness/geometry/angles.hpp"
#include "situation_awareness/geometry/arc.hpp"

namespace situation_awareness::splinegons_test {
namespace {

Splinegon circle(const Eigen::Vector2d& center_m, double radius_m, int arcs) {
  Splinegon splinegon;
  splinegon.closed = true;
  for (int i = 0; i < arcs; ++i) {
    const double phi = 2.0 * kPi * i / arcs;
    splinegon.vertices.push_back(
        {center_m + radius_m * Eigen::Vector2d(std::cos(phi), std::sin(phi)), std::tan(0.5 * kPi / arcs), 0.1, false});
  }
  return splinegon;
}

/// A closed chain of arcs around the origin with any bulges, or an open one.
Splinegon random_splinegon(Random& random, bool closed) {
  Splinegon splinegon;
  splinegon.closed = closed;
  for (int i = 0; i < 9; ++i) {
    const double phi = 2.0 * kPi * i / 9.0, r_m = random.uniform(3.0, 5.0);
    splinegon.vertices.push_back({r_m * Eigen::Vector2d(std::cos(phi), std::sin(phi)), random.uniform(-0.5, 0.8),
                                  random.uniform(0.01, 0.1), true});
  }
  splinegon.vertices[3].bulge = 0.0;
  splinegon.vertices[4].bulge = 1e-12;
  if (!closed) splinegon.vertices.back().bulge = 0.0;
  return splinegon;
}

TEST(Splinegons, ACircleIsACircle) {
  for (const int arcs : {2, 4, 33}) {
    const Splinegon splinegon = circle({500.0, -300.0}, 4.0, arcs);
    EXPECT_NEAR(length_m(splinegon), 8.0 * kPi, 1e-11);
    EXPECT_NEAR(area_m2(splinegon), 16.0 * kPi, 1e-10);
    EXPECT_TRUE(is_simple(splinegon));
    Random random(1);
    for (int i = 0; i < 1000; ++i) {
      const Eigen::Vector2d v(random.uniform(-8.0, 8.0), random.uniform(-8.0, 8.0));
      const Eigen::Vector2d p_world_m = Eigen::Vector2d(500.0, -300.0) + v;
      EXPECT_NEAR(distance_m(splinegon, p_world_m), std::abs(v.norm() - 4.0), 1e-10);
      EXPECT_EQ(contains(splinegon, p_world_m), v.norm() < 4.0);
      EXPECT_EQ(is_in_envelope(splinegon, p_world_m), std::abs(v.norm() - 4.0) < 0.1 * kSigmasOf99Percent);
    }
  }
}

TEST(Splinegons, PointsAreOnTheArcsOfTheirBulges) {
  Random random(2);
  for (int trial = 0; trial < 100; ++trial) {
    const Splinegon splinegon = random_splinegon(random, trial % 2 == 0);
    for (std::size_t k = 0; k < arcs_of(splinegon); ++k) {
      const SplinegonVertex& from = splinegon.vertices[k];
      const SplinegonVertex& to = splinegon.vertices[(k + 1) % splinegon.vertices.size()];
      EXPECT_LT((point_at(splinegon, k, 0.0).p_world_m - from.p_world_m).norm(), 1e-12);
      EXPECT_LT((point_at(splinegon, k, 1.0).p_world_m - to.p_world_m).norm(), 1e-11);
      EXPECT_NEAR(point_at(splinegon, k, 0.25).sigma_m, 0.75 * from.sigma_m + 0.25 * to.sigma_m, 1e-15);
      if (std::abs(from.bulge) < 1e-6) continue;
      const Arc arc = arc_with_bulge(from.p_world_m, to.p_world_m, from.bulge);
      const double part = random.uniform();
      const Pose2 expected = pose_at(arc, part * length_m(arc));
      const SplinegonPoint point = point_at(splinegon, k, part);
      EXPECT_LT((point.p_world_m - expected.translation_m).norm(), 1e-11 * (1.0 + arc.radius_m));
      EXPECT_NEAR(point.along_world.x(), std::cos(expected.yaw_rad), 1e-9);
      EXPECT_NEAR(point.along_world.y(), std::sin(expected.yaw_rad), 1e-9);
    }
  }
}

TEST(Splinegons, LengthAreaAndInsideAreThoseOfAFinePolygon) {
  Random random(3);
  for (int trial = 0; trial < 50; ++trial) {
    const Splinegon splinegon = random_splinegon(random, true);
    const std::vector<SplinegonPoint> points = sampled(splinegon, 0.002);
    double polygon_m = 0.0, polygon_m2 = 0.0;
    for (std::size_t i = 0; i < points.size(); ++i) {
      const Eigen::Vector2d a = points[i].p_world_m, b = points[(i + 1) % points.size()].p_world_m;
      polygon_m += (b - a).norm();
      polygon_m2 += 0.5 * (a.x() * b.y() - a.y() * b.x());
      EXPECT_LT((b - a).norm(), 0.002 + 1e-9);
    }
    EXPECT_NEAR(length_m(splinegon), polygon_m, 1e-4);
    EXPECT_NEAR(area_m2(splinegon), polygon_m2, 1e-4);
    if (!is_simple(splinegon)) continue;
    for (int i = 0; i < 100; ++i) {
      const Eigen::Vector2d p(random.uniform(-7.0, 7.0), random.uniform(-7.0, 7.0));
      double turn_rad = 0.0, nearest_m = 1e9;
      for (std::size_t k = 0; k < points.size(); ++k) {
        const Eigen::Vector2d a = points[k].p_world_m - p, b = points[(k + 1) % points.size()].p_world_m - p;
        turn_rad += std::atan2(a.x() * b.y() - a.y() * b.x(), a.dot(b));
        nearest_m = std::min(nearest_m, a.norm());
      }
      EXPECT_NEAR(distance_m(splinegon, p), nearest_m, 2e-3);
      if (nearest_m < 0.01) continue;
      EXPECT_EQ(contains(splinegon, p), turn_rad > kPi) << p.transpose();
    }
  }
}

TEST(Splinegons, TheNearestPlaceIsNearest) {
  Random random(4);
  for (int trial = 0; trial < 200; ++trial) {
    Splinegon arc;  // also of more than half a circle
    arc.vertices = {{{0.0, 0.0}, random.uniform(-3.0, 3.0), 0.1, false}, {{1.0, 0.5}, 0.0, 0.2, false}};
    for (int i = 0; i < 20; ++i) {
      const Eigen::Vector2d p(random.uniform(-3.0, 3.0), random.uniform(-3.0, 3.0));
      double least_m = 1e9;
      for (int k = 0; k <= 1000; ++k) {
        least_m = std::min(least_m, (point_at(arc, 0, 0.001 * k).p_world_m - p).norm());
      }
      EXPECT_LT(distance_m(arc, p), least_m + 1e-12);
      EXPECT_GT(distance_m(arc, p), least_m - 0.01);
    }
  }
}

TEST(Splinegons, MeetsItself) {
  Splinegon eight;
  eight.closed = true;
  for (const Eigen::Vector2d& p :
       {Eigen::Vector2d(0.0, 0.0), Eigen::Vector2d(2.0, 2.0), Eigen::Vector2d(2.0, 0.0), Eigen::Vector2d(0.0, 2.0)}) {
    eight.vertices.push_back({p, 0.0, 0.0, true});
  }
  EXPECT_FALSE(is_simple(eight));
  std::swap(eight.vertices[1], eight.vertices[2]);
  EXPECT_TRUE(is_simple(eight));
  EXPECT_GT(area_m2(eight), 0.0);
  // Two sides that bend through one another.
  eight.vertices[0].bulge = -1.2;
  eight.vertices[2].bulge = -1.2;
  EXPECT_FALSE(is_simple(eight));
}

TEST(Splinegons, TheEnvelopeIsOffsetToBothSides) {
  const SplinegonEnvelope envelope = envelope_of(circle({1.0, 2.0}, 4.0, 8), 0.1);
  for (const Eigen::Vector2d& p : envelope.free_side_world_m) {
    EXPECT_NEAR((p - Eigen::Vector2d(1.0, 2.0)).norm(), 4.0 + 0.1 * kSigmasOf99Percent, 1e-12);
  }
  for (const Eigen::Vector2d& p : envelope.obstacle_side_world_m) {
    EXPECT_NEAR((p - Eigen::Vector2d(1.0, 2.0)).norm(), 4.0 - 0.1 * kSigmasOf99Percent, 1e-12);
  }
}

// Half a millimetre: of an arc that is 2.3 mm from its chord.
TEST(Splinegons, MeetsItselfWhereAVertexIsBeyondAnArc) {
  Splinegon splinegon;
  splinegon.closed = true;
  for (const auto& [x, y, bulge] :
       {std::tuple(0.0, 0.0, -0.0092), std::tuple(0.5, 0.0, 0.0), std::tuple(1.0, 0.0, 0.0), std::tuple(1.0, 1.0, 0.0),
        std::tuple(0.125, 0.0012, 0.0), std::tuple(0.0, 1.0, 0.0)}) {
    splinegon.vertices.push_back({{x, y}, bulge, 0.01, true});
  }
  EXPECT_FALSE(is_simple(splinegon));
  splinegon.vertices[4].p_world_m.y() = 0.0020;
  EXPECT_TRUE(is_simple(splinegon));
}

}  // namespace
}  // namespace situation_awareness::splinegons_test

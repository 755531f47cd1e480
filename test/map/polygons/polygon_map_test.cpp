// SPDX-License-Identifier: BSD-3-Clause
#include "situation_awareness/map/polygons/polygon_map.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <limits>
#include <set>
#include <vector>

#include "situation_awareness/geometry/box.hpp"
#include "situation_awareness/points/horizontal_projection.hpp"
#include "situation_awareness/polylines/polyline_extraction.hpp"
#include "situation_awareness/segments/segmentation.hpp"
#include "support/level_scene.hpp"
#include "support/refusal.hpp"

namespace situation_awareness::polygon_map_test {
namespace {

constexpr double kPeriod_s = 0.04;
constexpr double kSigma_m = 0.01;

using Walls = std::vector<LevelScene::Wall>;

void add_box(Walls& walls, const Box& box) {
  const std::array<Eigen::Vector2d, 4> at = corners(box);
  for (std::size_t i = 0; i < at.size(); ++i) walls.push_back({at[i], at[(i + 1) % at.size()]});
}

/// A room of 6 m x 4 m about the origin.
Walls room() {
  Walls walls;
  add_box(walls, {{0.0, 0.0}, 0.0, 3.0, 2.0});
  return walls;
}

/// A scanner at a known pose in a world of walls, and the map of what it sees.
class World {
 public:
  explicit World(std::uint64_t seed, const PolygonMapParams& params = {}) : random_(seed), map_(params) {}

  /// The scans of so many seconds, from a place that moves.
  template <class PoseAt>
  void see(const Walls& walls, double duration_s, const PoseAt& pose_at) {
    for (double t = 0.0; t < duration_s; t += kPeriod_s) {
      const Pose2 T_world_level = pose_at(t);
      LevelScene scene;
      scene.angle_min_rad = -kPi;
      scene.beams = 720;
      scene.angle_increment_rad = 2.0 * kPi / scene.beams;
      const Pose2 T_level_world = inverse(T_world_level);
      for (const LevelScene::Wall& wall : walls)
        scene.walls.push_back({T_level_world * wall.from, T_level_world * wall.to});
      Scan scan = scene.scan(&random_, kSigma_m);
      scan.stamp_ns = stamp_ns_;
      Points points = project_horizontally(scan, Eigen::Isometry3d::Identity());
      points.T_world_level = T_world_level * pose_error();
      update_ = map_.update(extract_polylines(segment(points, {}), {}), Eigen::Matrix3d::Zero(), std::move(update_));
      stamp_ns_ += static_cast<std::int64_t>(kPeriod_s * 1e9);
    }
    polygons_ = map_.polygons();
  }

  void see(const Walls& walls, double duration_s, const Eigen::Vector2d& from_m = {0.3, 0.2}) {
    see(walls, duration_s, [&](double t) { return Pose2{from_m, 0.1 * t}; });
  }

  /// From now on the map is told poses that are off, by errors of these standard deviations, drawn anew for each scan.
  void set_pose_sigma(double sigma_m, double sigma_rad) {
    pose_sigma_m_ = sigma_m;
    pose_sigma_rad_ = sigma_rad;
  }

  void wait(double duration_s) { stamp_ns_ += static_cast<std::int64_t>(duration_s * 1e9); }

  const Polygons& polygons() const { return polygons_; }
  const PolygonMapUpdate& last_update() const { return update_; }
  PolygonMap& map() { return map_; }

  /// The elements of all chains, as they are now.
  std::vector<BoundaryElement> elements() {
    std::vector<BoundaryElement> result, of_chain;
    const std::size_t chains = map_.latest_polygons().chains.size();
    for (std::size_t c = 0; c < chains; ++c) {
      map_.elements_of(c, of_chain);
      result.insert(result.end(), of_chain.begin(), of_chain.end());
    }
    return result;
  }

 private:
  Pose2 pose_error() {
    if (pose_sigma_m_ == 0.0) return {};  // draws no random numbers
    return {{pose_sigma_m_ * random_.normal(), pose_sigma_m_ * random_.normal()}, pose_sigma_rad_ * random_.normal()};
  }

  Random random_;
  double pose_sigma_m_ = 0.0, pose_sigma_rad_ = 0.0;
  PolygonMap map_;
  std::int64_t stamp_ns_ = 1'000'000'000'000;
  PolygonMapUpdate update_;
  Polygons polygons_;
};

/// Towards the free side.
Eigen::Vector2d normal_of(const BoundaryElement& element) {
  return {-element.along_world.y(), element.along_world.x()};
}

double distance_m(const Eigen::Vector2d& p_m, const Eigen::Vector2d& a_m, const Eigen::Vector2d& b_m) {
  const Eigen::Vector2d way_m = b_m - a_m;
  const double part = std::clamp((p_m - a_m).dot(way_m) / std::max(way_m.squaredNorm(), 1e-12), 0.0, 1.0);
  return (p_m - a_m - part * way_m).norm();
}

/// Distance from the map.
double distance_m(const Eigen::Vector2d& p_m, const Polygons& polygons) {
  double least_m = std::numeric_limits<double>::infinity();
  for (const Chain& chain : polygons.chains) {
    for (std::size_t i = 0; i + 1 < chain.vertices.size() + (chain.closed ? 1 : 0); ++i) {
      least_m = std::min(least_m, distance_m(p_m, chain.vertices[i].p_world_m,
                                             chain.vertices[(i + 1) % chain.vertices.size()].p_world_m));
    }
  }
  return least_m;
}

double distance_m(const Eigen::Vector2d& p_m, const Walls& walls) {
  double least_m = std::numeric_limits<double>::infinity();
  for (const LevelScene::Wall& wall : walls) least_m = std::min(least_m, distance_m(p_m, wall.from, wall.to));
  return least_m;
}

/// Id of the chain nearest to a place.
std::uint64_t id_at(const Eigen::Vector2d& p_m, const Polygons& polygons) {
  std::uint64_t id = 0;
  double least_m = std::numeric_limits<double>::infinity();
  for (const Chain& chain : polygons.chains) {
    const double off_m = distance_m(p_m, Polygons{0, {chain}});
    if (off_m >= least_m) continue;
    least_m = off_m;
    id = chain.id;
  }
  return id;
}

TEST(PolygonMap, ARoomIsOneClosedChainOfItsFourCorners) {
  World world(1);
  world.see(room(), 6.0, [](double t) { return Pose2{{0.3 + 0.4 * std::sin(t), 0.2 + 0.4 * std::cos(t)}, 0.1 * t}; });
  ASSERT_EQ(world.polygons().chains.size(), 1U);
  const Chain& chain = world.polygons().chains[0];
  EXPECT_TRUE(chain.closed);
  EXPECT_EQ(chain.vertices.size(), 4U);
  EXPECT_GT(chain.p_exists, 0.9);
  for (const LevelScene::Wall& wall : room()) {
    double least_m = 1.0;
    for (const ChainVertex& vertex : chain.vertices) least_m = std::min(least_m, (vertex.p_world_m - wall.from).norm());
    EXPECT_LT(least_m, 0.005);
  }
}

// The errors of the walls average out, and are as large as sigma says.
TEST(PolygonMap, ErrorsAverageOutAndAreAsLargeAsSigmaSays) {
  double squares = 0.0, squares_m2 = 0.0;
  int samples = 0;
  for (std::uint64_t seed = 1; seed <= 10; ++seed) {
    World world(seed);
    world.see(room(), 4.0);
    for (const Chain& chain : world.polygons().chains) {
      for (std::size_t i = 0; i + 1 < chain.vertices.size() + (chain.closed ? 1 : 0); ++i) {
        const ChainVertex& from = chain.vertices[i];
        const ChainVertex& to = chain.vertices[(i + 1) % chain.vertices.size()];
        if ((to.p_world_m - from.p_world_m).norm() < 0.5) continue;
        for (const double part : {0.1, 0.3, 0.5, 0.7, 0.9}) {
          const Eigen::Vector2d p_m = from.p_world_m + part * (to.p_world_m - from.p_world_m);
          const double off_m = distance_m(p_m, room());
          squares_m2 += off_m * off_m;
          squares += std::pow(off_m / ((1.0 - part) * from.sigma_m + part * to.sigma_m), 2);
          ++samples;
        }
      }
    }
  }
  ASSERT_GT(samples, 150);
  EXPECT_LT(std::sqrt(squares_m2 / samples), 0.0015);  // a hit's is 0.01
  EXPECT_LT(std::sqrt(squares / samples), 1.3);  // it has room for errors of poses that repeat, which are none here
}

TEST(PolygonMap, OpenEndsAreAsFarOffAsSigmaSays) {
  double squares = 0.0;
  int ends = 0;
  for (std::uint64_t seed = 1; seed <= 30; ++seed) {
    Random random(100 + seed);
    Walls panels;  // one in each direction
    for (int k = 0; k < 4; ++k) {
      const Pose2 T_world_panel{{0.0, 0.0}, 0.5 * kPi * k + random.uniform(-0.2, 0.2)};
      const double x_m = random.uniform(2.0, 8.0), y_m = random.uniform(-0.2, 0.2), half_m = random.uniform(0.4, 0.9);
      panels.push_back({T_world_panel * Eigen::Vector2d(x_m, y_m - half_m),  //
                        T_world_panel * Eigen::Vector2d(x_m, y_m + half_m)});
    }
    World world(seed);
    world.set_pose_sigma(0.002, 0.001);
    world.see(panels, 12.0, [](double t) {
      return Pose2{{1.5 * std::sin(0.5 * t), 1.5 * std::cos(0.5 * t)}, 0.1 * t};
    });
    ASSERT_EQ(world.polygons().chains.size(), panels.size());
    for (const Chain& chain : world.polygons().chains) {
      ASSERT_FALSE(chain.closed);
      for (const ChainVertex* end : {&chain.vertices.front(), &chain.vertices.back()}) {
        double off_m = std::numeric_limits<double>::infinity();
        for (const LevelScene::Wall& panel : panels) {
          off_m = std::min({off_m, (end->p_world_m - panel.from).norm(), (end->p_world_m - panel.to).norm()});
        }
        squares += std::pow(off_m / end->sigma_m, 2);
        ++ends;
      }
    }
  }
  ASSERT_EQ(ends, 240);
  EXPECT_GT(std::sqrt(squares / ends), 0.5);
  EXPECT_LT(std::sqrt(squares / ends), 1.3);
}

TEST(PolygonMap, WhatWasTakenAwayGoesOnceBeamsPassAndTheWallBehindStays) {
  const Box box{{1.5, 0.0}, 0.3, 0.25, 0.2};
  Walls with_box = room();
  add_box(with_box, box);
  World world(2);
  world.see(with_box, 3.0);
  EXPECT_LT(distance_m(corners(box)[2], world.polygons()), 0.02);
  world.wait(10.0);
  world.see(room(), 2.0);
  for (const Eigen::Vector2d& corner_m : corners(box)) EXPECT_GT(distance_m(corner_m, world.polygons()), 0.3);
  for (const Chain& chain : world.polygons().chains) {
    for (const ChainVertex& vertex : chain.vertices) EXPECT_LT(distance_m(vertex.p_world_m, room()), 0.01);
  }
}

TEST(PolygonMap, NothingThatIsHiddenGoes) {
  const Box box{{2.2, 0.6}, 0.0, 0.15, 0.15};
  Walls with_box = room();
  add_box(with_box, box);
  World world(3);
  world.see(with_box, 3.0);
  const std::uint64_t id = id_at(box.center_m, world.polygons());
  const Eigen::Vector2d near_corner_m(2.05, 0.45);
  ASSERT_LT(distance_m(near_corner_m, world.polygons()), 0.02);
  // Put a screen before the box and take the box away behind it: nobody can know.
  Walls screened = room();
  screened.push_back({{1.2, -0.6}, {1.2, 1.4}});
  world.wait(10.0);
  world.see(screened, 20.0);
  EXPECT_LT(distance_m(near_corner_m, world.polygons()), 0.02);
  EXPECT_EQ(id_at(box.center_m, world.polygons()), id);
}

TEST(PolygonMap, ASideThatFacesAwayStaysThoughBeamsPassBesideItAndGoesWithItsThing) {
  Walls empty;
  add_box(empty, {{0.0, 3.5}, 0.0, 6.0, 4.0});
  Walls with_box = empty;
  add_box(with_box, {{0.0, -0.15}, 0.0, 0.35, 0.2});
  World world(5);
  // Its side at x = -0.35, 15 cm from the wall at its back, seen from the left; then along it, from 7 m away.
  world.see(with_box, 3.0, [](double) { return Pose2{{-2.5, 2.0}, 0.0}; });
  // The pose is now off by 2.5 cm, so that beams seem to go through it.
  const auto along = [](double t) { return Pose2{{-0.15 - 0.01 * t, 7.0}, -0.5 * kPi}; };
  Walls shifted = with_box;
  for (LevelScene::Wall& wall : shifted) wall.from.x() += 0.025, wall.to.x() += 0.025;
  world.see(shifted, 20.0, along);
  for (const double y : {-0.3, -0.2, -0.1, 0.0}) EXPECT_LT(distance_m({-0.35, y}, world.polygons()), 0.05) << y;
  world.wait(10.0);
  world.see(empty, 20.0, along);
  EXPECT_GT(distance_m({-0.35, -0.1}, world.polygons()), 0.2);
}

TEST(PolygonMap, WhoStandsForAMomentIsNotOnTheMapWhatIsParkedIs) {
  const auto person_at = [](const Eigen::Vector2d& at_m) {
    Walls walls = room();
    add_box(walls, {at_m, 0.2, 0.12, 0.12});
    return walls;
  };
  World world(4);
  world.see(room(), 3.0);
  for (double x = 2.4; x > 1.3; x -= 0.04) world.see(person_at({x, 0.5}), kPeriod_s);
  world.see(person_at({1.3, 0.5}), 3.0);
  EXPECT_GT(distance_m({1.3, 0.5}, world.polygons()), 0.3);
  world.see(person_at({1.3, 0.5}), 9.0);  // it has been there for 12 s
  EXPECT_LT(distance_m({1.18, 0.4}, world.polygons()), 0.1);
  for (double x = 1.3; x < 2.4; x += 0.04) world.see(person_at({x, 0.5}), kPeriod_s);
  world.see(room(), 2.0);
  EXPECT_GT(distance_m({1.3, 0.5}, world.polygons()), 0.5);
  for (const Chain& chain : world.polygons().chains) {
    for (const ChainVertex& vertex : chain.vertices) EXPECT_LT(distance_m(vertex.p_world_m, room()), 0.02);
  }
}

TEST(PolygonMap, WhatStoodThereWhenThePlaceWasFirstSeenIsKnownWithinASecond) {
  Walls with_box = room();
  add_box(with_box, {{1.5, 0.0}, 0.3, 0.25, 0.2});
  World world(5);
  world.see(room(), 3.0);
  world.wait(10.0);  // the scanner was off
  world.see(with_box, 1.0);
  EXPECT_LT(distance_m({1.25, -0.05}, world.polygons()), 0.06);
}

TEST(PolygonMap, IdsStayAndAreUsedOnce) {
  Walls with_box = room();
  add_box(with_box, {{1.5, 0.0}, 0.3, 0.25, 0.2});
  World world(6);
  world.see(with_box, 3.0);
  const std::uint64_t wall = id_at({-3.0, 0.0}, world.polygons());
  const std::uint64_t box = id_at({1.25, -0.05}, world.polygons());
  EXPECT_NE(wall, box);
  world.wait(20.0);
  world.see(with_box, 3.0, {0.5, -0.9});
  EXPECT_EQ(id_at({-3.0, 0.0}, world.polygons()), wall);
  EXPECT_EQ(id_at({1.25, -0.05}, world.polygons()), box);
  world.see(room(), 3.0);
  world.wait(20.0);
  world.see(with_box, 3.0);
  EXPECT_NE(id_at({1.25, -0.05}, world.polygons()), box);
  std::set<std::uint64_t> ids;
  for (const Chain& chain : world.polygons().chains) EXPECT_TRUE(ids.insert(chain.id).second);
}

TEST(PolygonMap, APostIsOneChainFromAllSidesAndStaysThoughItIsMissedFromAfar) {
  constexpr double kHalf_m = 0.03;
  Walls with_post = room();
  const Eigen::Vector2d post_m(2.0, 1.2);
  add_box(with_post, {post_m, 0.3, kHalf_m, kHalf_m});
  World world(11);
  const auto ids_at_post = [&] {
    std::set<std::uint64_t> ids;
    for (const Chain& chain : world.polygons().chains) {
      if (distance_m(post_m, Polygons{0, {chain}}) < 0.06) ids.insert(chain.id);
    }
    return ids;
  };
  for (const auto& from_m : {Eigen::Vector2d(1.2, 1.0), Eigen::Vector2d(2.2, 0.3), Eigen::Vector2d(2.7, 1.5)}) {
    world.see(with_post, 2.0, from_m);
  }
  const std::set<std::uint64_t> ids = ids_at_post();
  EXPECT_EQ(ids.size(), 1U);
  world.see(with_post, 20.0, {-2.8, -1.8});  // beams are nearly 5 cm apart
  EXPECT_EQ(ids_at_post(), ids);
  world.see(room(), 4.0, {1.2, 1.0});
  EXPECT_TRUE(ids_at_post().empty());
}

TEST(PolygonMap, ASecondVisitWithAPoseThatIsOffDoublesNothing) {
  World world(7);
  world.see(room(), 3.0);
  Polylines nothing;
  world.wait(10.0);
  world.see(room(), 3.0, [](double t) { return Pose2{{0.32, 0.19}, 0.1 * t + 0.002}; });
  double length_m = 0.0;
  for (const Chain& chain : world.polygons().chains) {
    for (std::size_t i = 0; i + 1 < chain.vertices.size() + (chain.closed ? 1 : 0); ++i) {
      length_m += (chain.vertices[(i + 1) % chain.vertices.size()].p_world_m - chain.vertices[i].p_world_m).norm();
    }
  }
  EXPECT_NEAR(length_m, 20.0, 0.3);
}

// A hit that strays beyond the gate begins an element of its own. Others of the wall then draw it to the wall, where
// elements as far apart as they should be stand for all of it already. At the corners they come and go.
TEST(PolygonMap, AKnownWallGetsNoMoreElementsByHitsThatStray) {
  World world(1);
  const auto around = [](double t) { return Pose2{{0.3 + 0.4 * std::sin(t), 0.2 + 0.4 * std::cos(t)}, 0.1 * t}; };
  world.see(room(), 1.0, around);
  ASSERT_EQ(world.polygons().chains.size(), 1U);
  world.map().restore(world.polygons());
  world.map().update_chains();
  const auto of_walls = [&] {
    const std::vector<BoundaryElement> elements = world.elements();
    return std::count_if(elements.begin(), elements.end(), [](const BoundaryElement& element) {
      return (element.p_world_m.cwiseAbs() - Eigen::Vector2d(3.0, 2.0)).norm() > 0.15;
    });
  };
  const auto known = of_walls();
  EXPECT_NEAR(static_cast<double>(known), (20.0 - 8.0 * 0.15) / 0.04, 5.0);
  world.see(room(), 180.0, around);
  EXPECT_NEAR(static_cast<double>(of_walls()), static_cast<double>(known), 5.0);
}

// A motion that is the same for all moves the map as a whole, and its inverse moves it back.
TEST(PolygonMap, DeformsAsItIsTold) {
  World world(11);
  world.see(room(), 3.0);
  const Pose2 motion = {{3.0, -2.0}, 0.7};
  const std::vector<BoundaryElement> before = world.elements();
  world.map().deform([&](std::int64_t drawn_ns) {
    EXPECT_LE(world.polygons().chains.front().first_seen_ns, drawn_ns);
    EXPECT_LE(drawn_ns, world.polygons().stamp_ns);
    return motion;
  });
  EXPECT_GT(before.size(), 400U);
  for (const BoundaryElement& element : before) {
    // Found at its new place, so the index of places moved, too.
    EXPECT_TRUE(world.map().find_facing(motion * element.p_world_m, motion.rotation() * normal_of(element), 0.01));
  }
  world.map().deform([&](std::int64_t) { return inverse(motion); });
  world.see(room(), 1.0);
  ASSERT_EQ(world.polygons().chains.size(), 1U);
  EXPECT_TRUE(world.polygons().chains[0].closed);
}

// A room that was drawn twice, the second time beside the first one, is one room between both.
TEST(PolygonMap, MakesOneOfWhatWasDrawnTwice) {
  World world(13);
  const Pose2 beside = {{0.17, -0.16}, 0.0};
  world.see(room(), 2.0);
  world.map().merge_doubles(0.05);  // of its corners
  Polygons twice = world.map().polygons();
  world.map().restore(twice);
  const std::size_t once = world.map().elements();
  for (std::size_t c = twice.chains.size(); c-- > 0;) {
    Chain& copy = twice.chains.emplace_back(twice.chains[c]);
    copy.id = world.map().next_id() + c;
    copy.first_seen_ns = copy.last_seen_ns;
    for (ChainVertex& vertex : copy.vertices) vertex.p_world_m = beside * vertex.p_world_m;
  }
  world.map().restore(twice);
  world.map().merge_doubles(0.05);  // they are farther apart
  EXPECT_EQ(world.map().elements(), 2 * once);
  world.map().merge_doubles(0.2);
  EXPECT_LT(world.map().elements(), once + once / 20);
  Walls moved = room();
  for (auto& wall : moved) wall = {beside * wall.from, beside * wall.to};
  world.map().update_chains();
  for (const BoundaryElement& element : world.elements()) {
    const Eigen::Vector2d& p_m = element.p_world_m;
    EXPECT_LT(std::min(distance_m(p_m, room()), distance_m(p_m, moved)), 0.1);
  }
}

TEST(PolygonMap, GivesUpWhatIsBehindAPlace) {
  World world(12);
  world.see(room(), 3.0);
  const Eigen::Vector2d place_m = world.elements().front().p_world_m, n = normal_of(world.elements().front());
  const Eigen::Vector2d before_it_m = place_m + 0.3 * n;
  const auto is_there = [&] { return world.map().find_facing(place_m, n, 0.02).has_value(); };
  const std::int64_t first_ns = world.polygons().chains.front().first_seen_ns;
  const std::int64_t later_ns = world.polygons().stamp_ns + 10'000'000'000;
  world.map().give_up_behind(before_it_m, n, 0.1, 0.5, first_ns);  // hit since then
  EXPECT_TRUE(is_there());
  world.map().give_up_behind(before_it_m, -n, 0.1, 0.5, later_ns);  // it faces the other way
  EXPECT_TRUE(is_there());
  world.map().give_up_behind(before_it_m, n, 0.1, 0.25, later_ns);  // farther behind
  EXPECT_TRUE(is_there());
  world.map().give_up_behind(before_it_m, n, 0.1, 0.5, later_ns);
  EXPECT_FALSE(is_there());
}

// Ids that were used go on to be used for these chains only, also where the map is reset.
TEST(PolygonMap, GoesOnFromItsChains) {
  World world(14);
  world.see(room(), 3.0);
  const Polygons before = world.polygons();
  ASSERT_EQ(before.chains.size(), 1U);
  world.map().reset();
  EXPECT_EQ(world.map().elements(), 0U);
  EXPECT_TRUE(world.map().polygons().chains.empty());
  world.map().restore(before);
  world.see(room(), 1.0);
  ASSERT_EQ(world.polygons().chains.size(), 1U);
  EXPECT_EQ(world.polygons().chains[0].id, before.chains[0].id);
  for (const ChainVertex& vertex : world.polygons().chains[0].vertices) {
    EXPECT_LT(distance_m(vertex.p_world_m, before), 0.02);
  }
  world.map().reset();
  world.see(room(), 1.0);
  ASSERT_EQ(world.polygons().chains.size(), 1U);
  EXPECT_GT(world.polygons().chains[0].id, before.chains[0].id);
}

TEST(PolygonMap, RefusesChainsThatNoMapHasAndStaysAsItIs) {
  World world(15);
  world.see(room(), 1.0);
  const std::size_t elements = world.map().elements();
  const auto expect_refused = [&](const auto& change) {
    Polygons polygons = world.polygons();
    change(polygons.chains[0]);
    EXPECT_THROW(world.map().restore(polygons), std::invalid_argument);
  };
  expect_refused([](Chain& chain) { chain.vertices[0].p_world_m.x() = 2e4; });  // too many elements
  expect_refused([](Chain& chain) {
    for (ChainVertex& vertex : chain.vertices) vertex.p_world_m.x() += 2e6;
  });
  expect_refused([](Chain& chain) { chain.vertices[0].sigma_m = std::numeric_limits<double>::quiet_NaN(); });
  expect_refused([](Chain& chain) { chain.vertices[0].sigma_m = chain.vertices[1].sigma_m = 0.0; });
  expect_refused([](Chain& chain) { chain.last_seen_ns += 1'000'000'000; });
  expect_refused([](Chain& chain) { chain.first_seen_ns = std::numeric_limits<std::int64_t>::min(); });
  EXPECT_EQ(world.map().elements(), elements);
}

TEST(PolygonMap, SameInputSameMap) {
  World first(8), second(8);
  for (World* world : {&first, &second}) world->see(room(), 2.0);
  ASSERT_EQ(first.polygons().chains.size(), second.polygons().chains.size());
  for (std::size_t c = 0; c < first.polygons().chains.size(); ++c) {
    const Chain& a = first.polygons().chains[c];
    const Chain& b = second.polygons().chains[c];
    ASSERT_EQ(a.vertices.size(), b.vertices.size());
    EXPECT_EQ(a.id, b.id);
    for (std::size_t i = 0; i < a.vertices.size(); ++i) EXPECT_EQ(a.vertices[i].p_world_m, b.vertices[i].p_world_m);
  }
}

// A box on which no beam returns any more may have been lost by the scanner.
TEST(PolygonMap, BeamsWithoutAReturnAreWeakEvidence) {
  const Box box{{1.5, 0.0}, 0.3, 0.25, 0.2};
  Walls with_box;
  add_box(with_box, box);
  World world(9);
  world.see(with_box, 3.0);
  ASSERT_LT(distance_m(corners(box)[2], world.polygons()), 0.05);
  world.see({}, 2.0);
  EXPECT_LT(distance_m(corners(box)[2], world.polygons()), 0.05);
  world.see({}, 20.0);
  EXPECT_TRUE(world.polygons().chains.empty());
}

TEST(PolygonMap, FarFromTheOriginItIsTheSame) {
  const Eigen::Vector2d far_m(500'000.0, 5'000'000.0);  // UTM
  Walls moved = room();
  for (LevelScene::Wall& wall : moved) wall.from += far_m, wall.to += far_m;
  World here(10), there(10);
  here.see(room(), 3.0);
  there.see(moved, 3.0, Eigen::Vector2d(far_m + Eigen::Vector2d(0.3, 0.2)));
  ASSERT_EQ(here.polygons().chains.size(), 1U);
  ASSERT_EQ(there.polygons().chains.size(), 1U);
  const Chain& chain = there.polygons().chains[0];
  for (const ChainVertex& vertex : chain.vertices) EXPECT_LT(distance_m(vertex.p_world_m, moved), 0.005);
}

TEST(PolygonMap, StampsThatDoNotGoOnAndUncertainPosesAreCounted) {
  PolygonMap map({});
  Polylines polylines;
  polylines.stamp_ns = 5;
  EXPECT_TRUE(map.update(polylines, Eigen::Matrix3d::Zero()).reasons.empty());
  EXPECT_EQ(map.update(polylines, Eigen::Matrix3d::Zero()).reasons.of("stamp not after the one before"), 1U);
  polylines.stamp_ns = 6;
  EXPECT_EQ(map.update(polylines, Eigen::Matrix3d::Identity()).reasons.of("pose not known well enough"), 1U);
  polylines.stamp_ns = 7;
  const Eigen::Matrix3d yaw_not_known = Eigen::Vector3d(0.0, 0.0, 1.0).asDiagonal();
  EXPECT_EQ(map.update(polylines, yaw_not_known).reasons.of("pose not known well enough"), 1U);
}

TEST(PolygonMap, NamesFieldAndBound) {
  PolygonMapParams params;
  params.spacing_m = 0.0;
  EXPECT_TRUE(names(refusal_of([&] { PolygonMap map(params); }), {"polygons.spacing_m"}));
}

}  // namespace
}  // namespace situation_awareness::polygon_map_test

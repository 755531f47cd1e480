// SPDX-License-Identifier: BSD-3-Clause
#include "situation_awareness/map/polygons/map_chains.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <limits>
#include <map>
#include <vector>

#include <gtest/gtest.h>

#include "map/polygons/room_polylines.hpp"
#include "map/polygons/same_chains.hpp"
#include "situation_awareness/common/random.hpp"
#include "situation_awareness/common/time.hpp"
#include "situation_awareness/geometry/angles.hpp"
#include "situation_awareness/geometry/box.hpp"
#include "situation_awareness/map/polygons/polygon_map.hpp"
#include "situation_awareness/path/obstacles.hpp"
#include "situation_awareness/points/horizontal_projection.hpp"
#include "situation_awareness/polylines/polyline_extraction.hpp"
#include "situation_awareness/segments/segmentation.hpp"
#include "support/features.hpp"
#include "support/level_scene.hpp"
#include "support/street.hpp"

namespace situation_awareness::map_chains_test {
namespace {

const Eigen::Matrix3d kCovariance = Eigen::Vector3d(1e-6, 1e-6, 1e-7).asDiagonal();

Polylines polylines_of(const Points& points) { return extract_polylines(segment(points, {}), {}); }

using UpdateChains = const ChainChanges& (PolygonMap::*)();

/// A copy of the chains of a map, made of what the map says that each update changed.
class Mirror {
 public:
  explicit Mirror(UpdateChains update_chains = &PolygonMap::update_chains) : update_chains_(update_chains) {}

  void follow(PolygonMap& map) {
    const ChainChanges& changes = (map.*update_chains_)();
    EXPECT_TRUE(std::is_sorted(changes.changed.begin(), changes.changed.end()));
    for (const std::uint64_t id : changes.gone) EXPECT_EQ(chains_.erase(id), 1U) << id << " was not there";
    for (const std::uint64_t id : changes.changed) {
      ASSERT_NE(map.chain(id), nullptr);
      chains_[id] = *map.chain(id);
    }
    changed_ += changes.changed.size();
    gone_ += changes.gone.size();
  }
  void expect_equals(PolygonMap& map) const {
    const Polygons polygons = map.latest_polygons();
    ASSERT_EQ(polygons.chains.size(), chains_.size());
    for (const Chain& chain : polygons.chains) {
      ASSERT_EQ(chains_.count(chain.id), 1U);
      expect_same(chain, chains_.at(chain.id));
    }
  }
  std::size_t changed() const { return changed_; }
  std::size_t gone() const { return gone_; }

 private:
  UpdateChains update_chains_;
  std::map<std::uint64_t, Chain> chains_;
  std::size_t changed_ = 0, gone_ = 0;
};

void expect_same_latest_chains(PolygonMap& a, PolygonMap& b, int scan) {
  const Polygons of_a = a.latest_polygons(), of_b = b.latest_polygons();
  ASSERT_EQ(of_a.chains.size(), of_b.chains.size()) << "at scan " << scan;
  for (std::size_t c = 0; c < of_a.chains.size(); ++c) expect_same(of_a.chains[c], of_b.chains[c]);
}

void expect_same_chains(PolygonMap& a, PolygonMap& b, int scan) {
  a.update_chains();
  b.update_chains();
  expect_same_latest_chains(a, b, scan);
}

// A motion that moves nothing: every element may be another one then.
void touch_all(PolygonMap& map) {
  map.deform([](std::int64_t /*drawn_ns*/) { return Pose2{}; });
}

/// Updates a map and its chains, and where it `is_compared`, linking all again from the same state has to make the
/// same.
void update(PolygonMap& map, const Polylines& polylines, int scan, bool is_compared) {
  PolygonMap anew = map;
  map.update(polylines, kCovariance);
  map.update_chains();
  if (!is_compared) return;
  anew.update(polylines, kCovariance);
  touch_all(anew);
  expect_same_chains(map, anew, scan);
}

TEST(MapChains, AreThoseOfLinkingAllAgainWhereAllIsInView) {
  RoomPolylines room(3);
  room.add_box({{1.5, 1.0}, 0.3, 0.2, 0.15});
  room.add_box({{-1.0, -0.8}, 0.7, 0.3, 0.1});
  PolygonMap by_change({}), anew({});
  for (int i = 0; i < 120; ++i) {
    if (i == 70) room.remove_box();
    const Polylines polylines = room.next();
    by_change.update(polylines, kCovariance);
    anew.update(polylines, kCovariance);
    touch_all(anew);
    ASSERT_NO_FATAL_FAILURE(expect_same_chains(by_change, anew, i));
  }
}

// Nothing is lost or doubled where linking by tiles begins and ends, and what is hit seldom goes when it is old enough,
// though nothing beside it changes: on a drive to and fro through a street a scan makes the chains that linking all
// again makes from the same state.
TEST(MapChains, OfAStreetAreThoseOfLinkingAllAgain) {
  StreetDrive street(1);
  PolygonMap map({});
  for (int i = 0; i < 200; ++i) {
    if (i == 120) street.turn_round();
    ASSERT_NO_FATAL_FAILURE(update(map, polylines_of(street.next()), i, i % 7 == 6));
  }
  EXPECT_GT(map.polygons().chains.size(), 100U);
}

/// Scans of a drive along a corridor full of small boxes, of which those within 4 m are in view, with poses that err.
class ClutteredDrive {
 public:
  explicit ClutteredDrive(std::uint64_t seed) : random_(seed) {
    add({{0.0, 0.0}, 0.0, 15.0, 2.0});
    for (int k = 0; k < 260; ++k) {
      const double x_m = 14.0 * (2.0 * random_.uniform() - 1.0);
      const double y_m = (k % 2 == 0 ? 1.0 : -1.0) * (0.9 + random_.uniform());
      add({{x_m, y_m}, 3.0 * random_.uniform(), 0.02 + 0.08 * random_.uniform(), 0.005 + 0.03 * random_.uniform()});
    }
  }
  Polylines next() {
    const double t_s = 0.1 * scans_++;
    const Pose2 T_world_level{{12.0 * std::sin(0.09 * t_s), 0.3 * std::sin(t_s)}, 0.5 * t_s};
    LevelScene scene;
    scene.angle_min_rad = -kPi;
    scene.beams = 540;
    scene.angle_increment_rad = 2.0 * kPi / scene.beams;
    scene.max_range_m = 4.0;
    const Pose2 T_level_world = inverse(T_world_level);
    for (const LevelScene::Wall& wall : walls_) {
      scene.walls.push_back({T_level_world * wall.from, T_level_world * wall.to});
    }
    Scan scan = scene.scan(&random_, 0.015);
    scan.stamp_ns = 1'000'000'000'000 + 10'000'000 * static_cast<std::int64_t>(scans_);
    Points points = project_horizontally(scan, Eigen::Isometry3d::Identity());
    points.T_world_level = T_world_level;
    points.T_world_level.translation_m += 0.01 * Eigen::Vector2d(random_.normal(), random_.normal());
    return polylines_of(points);
  }

 private:
  void add(const Box& box) {
    const std::array<Eigen::Vector2d, 4> at_m = corners(box);
    for (std::size_t i = 0; i < at_m.size(); ++i) walls_.push_back({at_m[i], at_m[(i + 1) % at_m.size()]});
  }

  Random random_;
  std::vector<LevelScene::Wall> walls_;
  int scans_ = 0;
};

// Scan by scan, each from the same state, and in less time than that after which elements that are hit seldom are left
// out: that depends on time alone.
TEST(MapChains, EachScanMakesTheSameAsLinkingAllAgain) {
  ClutteredDrive drive(1);
  PolygonMap map({});
  std::size_t compared = 0;
  for (int i = 0; i < 480; ++i) {
    const bool is_compared = i % 5 == 0;
    ASSERT_NO_FATAL_FAILURE(update(map, drive.next(), i, is_compared));
    if (is_compared) compared += map.polygons().chains.size();
  }
  EXPECT_GT(compared, 5000U);
}

void follow_a_room(UpdateChains update_chains) {
  RoomPolylines room(5);
  room.add_box({{1.5, 1.0}, 0.3, 0.2, 0.15});
  PolygonMap map({});
  Mirror mirror(update_chains);
  for (int i = 0; i < 150; ++i) {
    if (i == 60) room.remove_box();
    if (i == 100) room.add_box({{-1.0, -0.8}, 0.7, 0.3, 0.1});
    map.update(room.next(), kCovariance);
    mirror.follow(map);
    mirror.expect_equals(map);
  }
  EXPECT_GT(mirror.gone(), 0U);

  const Polygons saved = map.polygons();
  map.reset();
  mirror.follow(map);
  mirror.expect_equals(map);
  EXPECT_TRUE(map.polygons().chains.empty());
  map.restore(saved);
  mirror.follow(map);
  mirror.expect_equals(map);
  EXPECT_FALSE(map.polygons().chains.empty());
}

TEST(MapChains, WhoFollowsTheChangesHasTheMap) { follow_a_room(&PolygonMap::update_chains); }

TEST(MapChains, WhoFollowsTheChangesThatAreDueHasTheMap) { follow_a_room(&PolygonMap::update_due_chains); }

/// A room with chains that are made when they are due, beside those that are made with each scan.
class DueChains : public testing::Test {
 protected:
  static PolygonMapParams with_refresh(double refresh_s) {
    PolygonMapParams params;
    params.refresh_s = refresh_s;
    return params;
  }

  void update(PolygonMap& due) {
    const Polylines polylines = room_.next();
    each_.update(polylines, kCovariance);
    each_.update_chains();
    due.update(polylines, kCovariance);
    changes_ = due.update_due_chains();
  }
  std::int64_t latest_ns() const { return room_.stamp_ns() - RoomPolylines::kPeriod_ns; }

  /// Whether a chain has all of its places within half a metre of one.
  static bool is_at(const Eigen::Vector2d& middle_m, PolygonMap& map) {
    const std::vector<Chain> chains = map.latest_polygons().chains;
    return std::any_of(chains.begin(), chains.end(), [&](const Chain& chain) {
      return std::all_of(chain.vertices.begin(), chain.vertices.end(),
                         [&](const ChainVertex& vertex) { return (vertex.p_world_m - middle_m).norm() < 0.5; });
    });
  }

  RoomPolylines room_{11, 1'000'000'000'000, {{0.0, 0.0}, 0.0, 6.0, 4.0}};
  PolygonMap each_{PolygonMapParams{}};
  ChainChanges changes_;
};

// The walls stay as they are in most scans, by millimetres beside those that are made with each scan, but for what
// these are longer by; a corner between two of its elements may be at one or the other.
TEST_F(DueChains, WaitWhereElementsOnlyMove) {
  room_.add_box({{1.5, 1.0}, 0.3, 0.3, 0.2});
  PolygonMap due({});
  int made = 0, compared = 0;
  double sum_m = 0.0;
  for (int i = 0; i < 300; ++i) {
    update(due);
    made += changes_.changed.empty() ? 0 : 1;
    if (i < 150) continue;
    Obstacles made_now;
    for (const Chain& chain : each_.latest_polygons().chains) made_now.add(feature_of(chain));
    for (const Chain& chain : due.latest_polygons().chains) {
      EXPECT_LE(latest_ns() - chain.last_seen_ns, nanoseconds(PolygonMapParams{}.refresh_s)) << chain.id;
      for (const ChainVertex& vertex : chain.vertices) {
        const double off_m = distance_m(made_now, vertex.p_world_m);
        EXPECT_LT(off_m, PolygonMapParams{}.spacing_m) << chain.id << " at scan " << i;
        sum_m += off_m;
        ++compared;
      }
    }
  }
  EXPECT_LT(made, 100);
  EXPECT_LT(sum_m / compared, 0.001);
  EXPECT_EQ(each_.polygons().chains.size(), due.polygons().chains.size());
}

TEST_F(DueChains, TellAtOnceWhatComesAndWhatGoes) {
  PolygonMap due(with_refresh(0.5));
  const Eigen::Vector2d middle_m(1.5, 1.0);
  bool was_there = false;
  for (int i = 0; i < 260; ++i) {
    if (i == 100) {
      room_.set_stamp(room_.stamp_ns() + 60'000'000'000);  // what comes unseen is not parked
      room_.add_box({middle_m, 0.3, 0.3, 0.2});
    }
    if (i == 200) room_.remove_box();
    update(due);
    const bool is_there = is_at(middle_m, each_);
    EXPECT_EQ(is_at(middle_m, due), is_there) << "at scan " << i;
    was_there |= is_there;
  }
  EXPECT_TRUE(was_there);
  EXPECT_FALSE(is_at(middle_m, each_));
}

// While beams pass where a thing was, its log-odds are told as they fall, not once in a period.
TEST_F(DueChains, AreDoubtedAtOnce) {
  const Eigen::Vector2d middle_m(1.5, 1.0);
  room_.add_box({middle_m, 0.3, 0.3, 0.2});
  PolygonMap due(with_refresh(0.5));
  for (int i = 0; i < 100; ++i) update(due);
  room_.remove_box();
  const auto least_log_odds = [&](PolygonMap& map) {
    double least = std::numeric_limits<double>::infinity();
    for (const Chain& chain : map.latest_polygons().chains) {
      if ((chain.vertices[0].p_world_m - middle_m).norm() > 0.5) continue;
      least = std::min(least, std::log(chain.p_exists / (1.0 - chain.p_exists)));
    }
    return least;
  };
  int doubted = 0;
  for (int i = 0; i < 40; ++i) {
    update(due);
    const double is = least_log_odds(each_);
    if (is > 3.0) continue;
    ++doubted;
    EXPECT_LT(least_log_odds(due), is + 0.8) << "at scan " << i;
  }
  EXPECT_GT(doubted, 5);
}

TEST_F(DueChains, WithoutAPeriodAreThoseOfEachScan) {
  PolygonMap due(with_refresh(0.0));
  for (int i = 0; i < 120; ++i) {
    if (i == 40) room_.add_box({{1.5, 1.0}, 0.3, 0.3, 0.2});
    update(due);
    const Polygons of_each = each_.latest_polygons(), of_due = due.latest_polygons();
    ASSERT_EQ(of_due.chains.size(), of_each.chains.size());
    for (std::size_t c = 0; c < of_due.chains.size(); ++c) expect_same(of_due.chains[c], of_each.chains[c]);
  }
}

TEST_F(DueChains, SeenAgainAfterAWhileAreToldAtOnce) {
  const Eigen::Vector2d middle_m(1.5, 1.0);
  room_.add_box({middle_m, 0.3, 0.3, 0.2});
  PolygonMap due(with_refresh(0.5));
  for (int i = 0; i < 60; ++i) update(due);
  ASSERT_TRUE(is_at(middle_m, due));
  room_.look(radians(-180.0), 300);  // not at the box
  for (int i = 0; i < 50; ++i) update(due);
  while (changes_.changed.empty()) update(due);  // so that chains would wait now
  room_.look(radians(-180.0), 720);
  update(due);
  const std::vector<Chain> chains = due.latest_polygons().chains;
  const auto box = std::find_if(chains.begin(), chains.end(), [&](const Chain& chain) {
    return (chain.vertices[0].p_world_m - middle_m).norm() < 0.5;
  });
  ASSERT_NE(box, chains.end());
  EXPECT_EQ(box->last_seen_ns, latest_ns());
}

// Also those of a map that takes no more scans, as the pose is not known well enough.
TEST_F(DueChains, AreMadeInTimeWhateverTheScans) {
  PolygonMap due({});
  for (int i = 0; i < 60; ++i) update(due);
  do update(due);
  while (!changes_.changed.empty());
  for (const Chain& chain : due.latest_polygons().chains) EXPECT_LT(chain.last_seen_ns, latest_ns()) << "none waits";
  const Eigen::Matrix3d lost = Eigen::Matrix3d::Identity();
  for (int i = 0; i < 6; ++i) {
    due.update(room_.next(), lost);
    due.update_due_chains();
  }
  const Polygons waiting = due.latest_polygons(), made = due.polygons();
  ASSERT_EQ(waiting.chains.size(), made.chains.size());
  for (std::size_t c = 0; c < made.chains.size(); ++c) expect_same(waiting.chains[c], made.chains[c]);
}

TEST(MapChains, WhatIsOutOfReachDoesNotChange) {
  StreetDrive street(2);
  PolygonMap map({});
  Mirror mirror;
  std::size_t most = 0, before = 0;
  for (int i = 0; i < 240; ++i) {
    const double sensor_x_m = street.travelled_m();
    map.update(polylines_of(street.next()), kCovariance);
    mirror.follow(map);
    most = std::max(most, mirror.changed() - before);
    before = mirror.changed();
    if (i % 40 == 39) mirror.expect_equals(map);
    for (const std::uint64_t id : map.update_chains().changed) ADD_FAILURE() << id << " changed without a scan";
    if (i < 200) continue;
    for (const Chain& chain : map.polygons().chains) {
      double nearest_m = std::numeric_limits<double>::infinity();
      for (const ChainVertex& vertex : chain.vertices) {
        nearest_m = std::min(nearest_m, std::abs(vertex.p_world_m.x() - sensor_x_m));
      }
      if (nearest_m > 45.0) {
        EXPECT_LT(chain.last_seen_ns, 1'000'000'000'000 + i * StreetDrive::kPeriod_ns) << chain.id;
      }
    }
  }
  const std::size_t chains = map.polygons().chains.size();
  EXPECT_GT(chains, 40U);
  EXPECT_LT(most, chains / 2) << "a scan changes what is in view";
}

TEST(MapChains, AnIdStaysWithItsChainWhereverTheOthersGo) {
  StreetDrive street(4);
  PolygonMap map({});
  std::map<std::uint64_t, Eigen::Vector2d> place_m;  // of the middle of each chain, when it was last in view
  for (int i = 0; i < 400; ++i) {
    if (i == 200) street.turn_round();
    map.update(polylines_of(street.next()), kCovariance);
    const ChainChanges& changes = map.update_chains();
    for (const std::uint64_t id : changes.gone) place_m.erase(id);
    for (const std::uint64_t id : changes.changed) {
      Eigen::Vector2d middle_m = Eigen::Vector2d::Zero();
      for (const ChainVertex& vertex : map.chain(id)->vertices) middle_m += vertex.p_world_m;
      middle_m /= static_cast<double>(map.chain(id)->vertices.size());
      const auto known = place_m.find(id);
      if (known != place_m.end()) {
        EXPECT_LT((middle_m - known->second).norm(), 12.0) << id;
      }
      place_m[id] = middle_m;
    }
  }
  EXPECT_EQ(place_m.size(), map.polygons().chains.size());
}

}  // namespace
}  // namespace situation_awareness::map_chains_test

// SPDX-License-Identifier: BSD-3-Clause
#include "situation_awareness/map/polygons/map_chains.hpp"

#include <algorithm>
#include <cstdint>
#include <limits>
#include <map>
#include <vector>

#include <gtest/gtest.h>

#include "map/polygons/room_polylines.hpp"
#include "map/polygons/same_chains.hpp"
#include "situation_awareness/map/polygons/chain_state.hpp"
#include "situation_awareness/map/polygons/polygon_map.hpp"
#include "situation_awareness/polylines/polyline_extraction.hpp"
#include "situation_awareness/segments/segmentation.hpp"
#include "support/street.hpp"

namespace situation_awareness {
namespace {

const Eigen::Matrix3d kCovariance = Eigen::Vector3d(1e-6, 1e-6, 1e-7).asDiagonal();

Polylines polylines_of(const Points& points) { return extract_polylines(segment(points, {}), {}); }

/// A copy of the chains of a map, made of what the map says that each update changed.
class Mirror {
 public:
  void follow(PolygonMap& map) {
    const ChainChanges& changes = map.update_chains();
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
    const Polygons polygons = map.polygons();
    ASSERT_EQ(polygons.chains.size(), chains_.size());
    for (const Chain& chain : polygons.chains) {
      ASSERT_EQ(chains_.count(chain.id), 1U);
      expect_same(chain, chains_.at(chain.id));
    }
  }
  std::size_t changed() const { return changed_; }
  std::size_t gone() const { return gone_; }

 private:
  std::map<std::uint64_t, Chain> chains_;
  std::size_t changed_ = 0, gone_ = 0;
};

// A motion that moves nothing: every element may be another one then.
void touch_all(PolygonMap& map) {
  map.deform([](std::int64_t /*drawn_ns*/) { return Pose2{}; });
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
    const Polygons a = by_change.polygons(), b = anew.polygons();
    ASSERT_EQ(a.chains.size(), b.chains.size()) << "after " << i;
    for (std::size_t c = 0; c < a.chains.size(); ++c) expect_same(a.chains[c], b.chains[c]);
  }
}

// Nothing is lost or doubled where linking by tiles begins and ends: after a drive to and fro the chains of a street
// are those that its elements make if all are linked again. What depends on the time since an element was seen is
// judged again then: single elements may go, and one of a long chain.
TEST(MapChains, OfAStreetAreThoseOfLinkingAllAgain) {
  StreetDrive street(1);
  PolygonMap map({});
  for (int i = 0; i < 200; ++i) {
    if (i == 120) street.turn_round();
    map.update(polylines_of(street.next()), kCovariance);
    map.update_chains();
  }
  const Polygons kept = map.polygons();
  touch_all(map);
  const Polygons anew = map.polygons();
  EXPECT_LE(anew.chains.size(), kept.chains.size());
  const auto large_of = [](const Polygons& polygons) {
    std::map<std::uint64_t, double> extents_m;
    for (const Chain& chain : polygons.chains) {
      if (extent_m(chain) > 1.0) extents_m[chain.id] = extent_m(chain);
    }
    return extents_m;
  };
  const std::map<std::uint64_t, double> before_m = large_of(kept), after_m = large_of(anew);
  EXPECT_GT(before_m.size(), 25U);
  ASSERT_EQ(before_m.size(), after_m.size());
  for (const auto& [id, length_m] : before_m) {
    ASSERT_EQ(after_m.count(id), 1U) << id;
    EXPECT_NEAR(after_m.at(id), length_m, 0.01) << id;
  }
}

TEST(MapChains, WhoFollowsTheChangesHasTheMap) {
  RoomPolylines room(5);
  room.add_box({{1.5, 1.0}, 0.3, 0.2, 0.15});
  PolygonMap map({});
  Mirror mirror;
  for (int i = 0; i < 150; ++i) {
    if (i == 60) room.remove_box();
    if (i == 100) room.add_box({{-1.0, -0.8}, 0.7, 0.3, 0.1});
    map.update(room.next(), kCovariance);
    mirror.follow(map);
    mirror.expect_equals(map);
  }
  EXPECT_GT(mirror.gone(), 0U);

  const PolygonMapSnapshot saved = map.snapshot();
  map.restore({});
  mirror.follow(map);
  mirror.expect_equals(map);
  EXPECT_TRUE(map.polygons().chains.empty());
  map.restore(saved);
  mirror.follow(map);
  mirror.expect_equals(map);
  EXPECT_FALSE(map.polygons().chains.empty());
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
}  // namespace situation_awareness

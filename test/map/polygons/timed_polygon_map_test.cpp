// SPDX-License-Identifier: BSD-3-Clause
#include "situation_awareness/map/polygons/timed_polygon_map.hpp"

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <limits>
#include <set>
#include <string>
#include <vector>

#include <gtest/gtest.h>

#include "map/polygons/room_polylines.hpp"
#include "map/polygons/same_chains.hpp"
#include "situation_awareness/common/time.hpp"
#include "situation_awareness/map/polygons/map_file.hpp"

namespace situation_awareness::timed_polygon_map_test {
namespace {

constexpr double kJump_s = 1.0;
const Eigen::Matrix3d kCovariance = Eigen::Vector3d(1e-6, 1e-6, 1e-7).asDiagonal();

TimedPolygonMap new_map(const ChainStateParams& states = {}) { return {PolygonMapParams{}, states, kJump_s}; }

std::string text_of(TimedPolygonMap& map) {
  PolygonMapSnapshot snapshot = map.snapshot();
  snapshot.world_frame = "map";
  return polygon_map_to_yaml(snapshot);
}

void see(TimedPolygonMap& map, RoomPolylines& room, int scans) {
  for (int i = 0; i < scans; ++i) map.update(room.next(), kCovariance);
}

void expect_same(const Polygons& a, const Polygons& b) {
  EXPECT_EQ(a.stamp_ns, b.stamp_ns);
  EXPECT_EQ(a.height_world_m, b.height_world_m);
  ASSERT_EQ(a.chains.size(), b.chains.size());
  for (std::size_t i = 0; i < a.chains.size(); ++i) expect_same(a.chains[i], b.chains[i]);
}

// The whole state goes through the file: with it, the map goes on as if nothing had happened, while a thing disappears,
// another one comes, and chains break.
TEST(TimedPolygonMap, ARestoredMapContinuesBitForBit) {
  for (const std::uint64_t seed : {1U, 2U, 3U}) {
    RoomPolylines room(seed);
    room.add_box({{1.5, 1.0}, 0.3, 0.2, 0.15});
    TimedPolygonMap map = new_map();
    see(map, room, 60);
    room.remove_box();
    see(map, room, 15);  // elements are being removed
    const std::string saved = text_of(map);
    TimedPolygonMap other = new_map();
    other.resume(polygon_map_from_yaml(saved, "saved"));
    EXPECT_EQ(text_of(other), saved);
    // The states of the chains are those of another transit.
    EXPECT_EQ(other.polygons().chains.size(), map.polygons().chains.size());
    room.add_box({{-1.0, -0.8}, 0.7, 0.3, 0.1});
    for (int i = 0; i < 120; ++i) {
      const Polylines polylines = room.next();
      map.update(polylines, kCovariance);
      other.update(polylines, kCovariance);
      if (i % 20 == 0 || i == 119) {
        ASSERT_EQ(text_of(map), text_of(other)) << "after " << i;
      }
    }
    EXPECT_FALSE(map.polygons().chains.empty());
  }
}

TEST(TimedPolygonMap, ReplayIsTheSameBitForBit) {
  RoomPolylines room(5);
  room.add_box({{1.5, 1.0}, 0.3, 0.2, 0.15});
  const std::vector<Polylines> scans = room.next(80);
  TimedPolygonMap a = new_map(), b = new_map();
  for (const Polylines& polylines : scans) a.update(polylines, kCovariance);
  for (const Polylines& polylines : scans) b.update(polylines, kCovariance);
  expect_same(a.polygons(), b.polygons());
  EXPECT_EQ(text_of(a), text_of(b));
}

/// The largest chain.
const Chain& wall_of(const TimedPolygonMap& map) {
  const std::vector<Chain>& chains = map.polygons().chains;
  return *std::max_element(chains.begin(), chains.end(),
                           [](const Chain& a, const Chain& b) { return extent_m(a) < extent_m(b); });
}

TEST(TimedPolygonMap, AChainIsNewThenKnownOrAWall) {
  RoomPolylines room(2);
  room.add_box({{1.5, 1.0}, 0.3, 0.2, 0.15});
  TimedPolygonMap map = new_map();
  see(map, room, 100);
  ASSERT_GE(map.size(), 2U);
  for (const Chain& chain : map.polygons().chains) EXPECT_EQ(chain.state, ChainState::kNew);
  EXPECT_EQ(map.polygons().height_world_m, 0.25);
  room.set_stamp(room.stamp_ns() + 30'000'000'000);  // the scanner was off
  see(map, room, 3);
  ASSERT_GE(map.size(), 2U);
  EXPECT_EQ(wall_of(map).state, ChainState::kWall);
  std::uint64_t box = 0;
  for (const Chain& chain : map.polygons().chains) {
    if ((chain.vertices[0].p_world_m - Eigen::Vector2d(1.5, 1.0)).norm() > 0.3) continue;
    EXPECT_EQ(chain.state, ChainState::kKnown);
    box = chain.id;
  }
  ASSERT_NE(box, 0U);

  room.remove_box();
  bool doubted = false;
  for (int i = 0; i < 60; ++i) {
    see(map, room, 1);
    for (const Chain& chain : map.polygons().chains) {
      doubted |= chain.id == box && chain.state == ChainState::kDoubted;
    }
  }
  EXPECT_TRUE(doubted) << "before it is removed";
  for (const Chain& chain : map.polygons().chains) EXPECT_NE(chain.id, box);
}

TEST(TimedPolygonMap, IdsAscendAndAreNeverUsedAgain) {
  RoomPolylines room(4);
  TimedPolygonMap map = new_map();
  see(map, room, 40);
  ASSERT_GE(map.size(), 1U);
  const std::uint64_t last = map.polygons().chains.back().id;
  map.reset();
  EXPECT_EQ(map.size(), 0U);
  EXPECT_EQ(map.stamp_ns(), TimedPolygonMap::kNoStamp);
  room.set_stamp(5'000'000'000);  // any time may follow
  see(map, room, 40);
  ASSERT_GE(map.size(), 1U);
  EXPECT_GT(map.polygons().chains.front().id, last);
  for (std::size_t i = 1; i < map.size(); ++i) {
    EXPECT_GT(map.polygons().chains[i].id, map.polygons().chains[i - 1].id);
  }
}

TEST(TimedPolygonMap, AStampThatGoesBackIsRefusedAndOneFarBackIsARestart) {
  RoomPolylines room(6);
  TimedPolygonMap map = new_map();
  see(map, room, 40);
  const std::string before = text_of(map);
  const std::int64_t latest_ns = map.stamp_ns();
  room.set_stamp(latest_ns);
  EXPECT_EQ(map.update(room.next(), kCovariance).reasons.of("stamp repeats"), 1U);
  room.set_stamp(latest_ns - 500'000'000);
  EXPECT_EQ(map.update(room.next(), kCovariance).reasons.of("stamp goes back"), 1U);
  EXPECT_EQ(text_of(map), before);
  EXPECT_EQ(map.stamp_ns(), latest_ns);
  const std::uint64_t last = map.polygons().chains.back().id;
  room.set_stamp(latest_ns - 100'000'000'000);
  for (int i = 0; i < StampOrder::kAgreeing - 1; ++i) {
    EXPECT_EQ(map.update(room.next(), kCovariance).reasons.of("stamp of another time"), 1U);
  }
  EXPECT_EQ(text_of(map), before) << "a jump is one that three agree with";
  EXPECT_EQ(map.update(room.next(), kCovariance).reasons.of("time jumped back: new map"), 1U);
  EXPECT_EQ(map.size(), 0U);
  EXPECT_EQ(map.stamp_ns(), room.stamp_ns() - RoomPolylines::kPeriod_ns);
  see(map, room, 40);
  ASSERT_GE(map.size(), 1U);
  EXPECT_GT(map.polygons().chains.front().id, last);
}

TEST(TimedPolygonMap, ALoadedMapFitsAnyClock) {
  RoomPolylines room(7);
  TimedPolygonMap map = new_map();
  see(map, room, 40);
  const PolygonMapSnapshot saved = map.snapshot();
  const std::size_t chains = map.size();
  for (const std::int64_t stamp_ns :
       {saved.stamp_ns + 3'600'000'000'000, saved.stamp_ns + 40'000'000, saved.stamp_ns, std::int64_t{1'000'000'000}}) {
    TimedPolygonMap other = new_map();
    other.resume(saved);
    EXPECT_EQ(other.stamp_ns(), saved.stamp_ns);
    EXPECT_EQ(other.size(), chains);
    RoomPolylines again(8, stamp_ns);
    const PolygonMapUpdate update = other.update(again.next(), kCovariance);
    EXPECT_EQ(other.stamp_ns(), stamp_ns);
    EXPECT_GT(update.fused, 600) << "the hits are on what was loaded";
    ASSERT_EQ(other.size(), chains);
    EXPECT_EQ(other.polygons().chains[0].id, map.polygons().chains[0].id);
    EXPECT_EQ(other.polygons().chains[0].state, ChainState::kWall) << "it was there before this transit";
    EXPECT_LE(other.polygons().chains[0].first_seen_ns, stamp_ns);
    const double waits_s = seconds_between(other.polygons().chains[0].last_seen_ns, stamp_ns);
    EXPECT_GE(waits_s, 0.0);
    EXPECT_LE(waits_s, PolygonMapParams{}.refresh_s);
    other.snapshot();  // which makes the chains that wait
    EXPECT_EQ(other.polygons().chains[0].last_seen_ns, stamp_ns);
  }
}

TEST(TimedPolygonMap, RefusesScansThatHaveNoPlace) {
  RoomPolylines room(9);
  TimedPolygonMap map = new_map();
  see(map, room, 10);
  const std::string before = text_of(map);
  const double nan = std::numeric_limits<double>::quiet_NaN();
  const Polylines good = room.next();
  const auto refused = [&](const Polylines& polylines, const Eigen::Matrix3d& covariance) {
    return map.update(polylines, covariance).reasons.of("scan with numbers that cannot be used") == 1;
  };
  Polylines bad = good;
  bad.hits[5].p_level_m.x() = nan;
  EXPECT_TRUE(refused(bad, kCovariance));
  bad = good;
  bad.hits[5].p_level_m.y() = 1e12;
  EXPECT_TRUE(refused(bad, kCovariance));
  bad = good;
  bad.T_world_level.yaw_rad = nan;
  EXPECT_TRUE(refused(bad, kCovariance));
  bad = good;
  bad.T_world_level.translation_m.x() = -1e8;
  EXPECT_TRUE(refused(bad, kCovariance));
  bad = good;
  bad.T_world_level.yaw_rad = 1e155;
  EXPECT_TRUE(refused(bad, kCovariance));
  bad = good;
  bad.T_world_level.translation_m.x() = 0.9e6;
  bad.hits[5].p_level_m =
      inverse(Pose2{Eigen::Vector2d::Zero(), bad.T_world_level.yaw_rad}) * Eigen::Vector2d(0.9e6, 0.0);
  EXPECT_TRUE(refused(bad, kCovariance)) << "a place that no saved map can have";
  bad = good;
  bad.hits[5].normal_level *= 2.0;
  EXPECT_TRUE(refused(bad, kCovariance));
  bad = good;
  bad.hits[5].sigma_m = 1e155;
  EXPECT_TRUE(refused(bad, kCovariance));
  bad = good;
  bad.free_space.range_m[5] = std::numeric_limits<float>::quiet_NaN();
  EXPECT_TRUE(refused(bad, kCovariance));
  bad = good;
  bad.free_space.azimuth_rad[5] = 1e9F;
  EXPECT_TRUE(refused(bad, kCovariance));
  bad = good;
  bad.free_space.range_m.pop_back();
  EXPECT_TRUE(refused(bad, kCovariance));
  EXPECT_TRUE(refused(good, nan * kCovariance));
  EXPECT_TRUE(refused(good, -kCovariance));
  Eigen::Matrix3d indefinite = kCovariance;
  indefinite(0, 1) = indefinite(1, 0) = 1.5 * kCovariance(0, 0);
  EXPECT_TRUE(refused(good, indefinite));
  EXPECT_EQ(text_of(map), before);
  EXPECT_FALSE(refused(good, kCovariance));
}

}  // namespace
}  // namespace situation_awareness::timed_polygon_map_test

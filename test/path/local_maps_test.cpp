// SPDX-License-Identifier: BSD-3-Clause
#include "situation_awareness/path/local_maps.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <filesystem>
#include <utility>
#include <variant>

#include "situation_awareness/geometry/angles.hpp"
#include "support/refusal.hpp"

namespace situation_awareness::local_maps_test {
namespace {

Path way() { return {false, {{{0.0, 0.0}, {}}, {{4.0, 0.5}, {}}, {{8.0, 0.0}, {}}, {{12.0, -0.5}, {}}}}; }

Map things() {
  Map map;
  map.stamp_ns = 1'700'000'000'123'456'799;
  const auto add = [&](FeatureId id, bool closed, const std::vector<Eigen::Vector2d>& places) {
    Feature& feature = map.features.emplace_back();
    feature.id = id;
    PolylineShape outline;
    outline.closed = closed;
    for (const Eigen::Vector2d& place : places) outline.vertices.push_back({place, 0.003 * static_cast<double>(id)});
    feature.shape = outline;
    feature.first_seen_ns = 1'700'000'000'123'456'789;
    feature.last_seen_ns = feature.first_seen_ns + 5;
    feature.p_exists = 1.0 - 1.0 / (3.0 * static_cast<double>(id));
    feature.motion = Motion::kFixed;
  };
  add(3, false, {{-1.0, 1.6}, {13.0, 1.6}});                       // a wall beside all
  add(5, true, {{1.0, 0.8}, {1.5, 0.8}, {1.5, 1.2}, {1.0, 1.2}});  // beside the first
  add(8, true, {{10.0, 5.0}, {11.0, 5.0}, {10.5, 6.0}});           // beside none
  Feature& person = map.features.emplace_back();                   // no outline
  person.id = 9;
  person.shape = EllipseShape{{{1.0, 0.0}, 0.0, 0.2, 0.2}, {}};
  return map;
}

const std::vector<ChainVertex>& vertices_of(const Feature& feature) {
  return std::get<PolylineShape>(feature.shape).vertices;
}

TEST(LocalMaps, HaveTheChainsWithinReach) {
  const SplinePath path(way());
  const std::vector<LocalMap> maps = local_maps(path, things(), 2.0);
  ASSERT_EQ(maps.size(), 3U);
  EXPECT_EQ(maps[0].chains.size(), 2U);
  EXPECT_EQ(maps[1].chains.size(), 1U);
  EXPECT_EQ(maps[2].chains.size(), 1U);
  const Map back = map_of(maps, path), all = things();
  EXPECT_EQ(back.stamp_ns, 0) << "nobody has seen yet that they are there";
  EXPECT_EQ(back.objects_stamp_ns, 0);
  ASSERT_EQ(back.features.size(), 2U) << "each once";
  for (std::size_t i = 0; i < 2; ++i) {
    EXPECT_EQ(back.features[i].id, all.features[i].id);
    EXPECT_EQ(back.features[i].motion, Motion::kFixed);
    EXPECT_EQ(back.features[i].p_exists, all.features[i].p_exists);
    EXPECT_EQ(back.features[i].last_seen_ns, all.features[i].last_seen_ns);
    EXPECT_TRUE(back.features[i].seen_by.file);
    for (std::size_t k = 0; k < vertices_of(back.features[i]).size(); ++k) {
      EXPECT_LT((vertices_of(back.features[i])[k].p_world_m - vertices_of(all.features[i])[k].p_world_m).norm(), 1e-9);
    }
  }
}

TEST(LocalMaps, TellWhatIsKnownOfAChain) {
  Map map = things();
  const auto state = [&] { return local_maps(SplinePath(way()), map, 2.0)[0].chains[1].state; };
  EXPECT_EQ(local_maps(SplinePath(way()), map, 2.0)[0].chains[0].state, ChainState::kWall);
  EXPECT_EQ(state(), ChainState::kKnown);
  map.features[1].motion = Motion::kStanding;
  EXPECT_EQ(state(), ChainState::kNew);
  map.features[1].p_exists = 0.7;
  EXPECT_EQ(state(), ChainState::kDoubted);
  EXPECT_EQ(map_of(local_maps(SplinePath(way()), map, 2.0), SplinePath(way())).features[1].motion, Motion::kStanding);
}

TEST(LocalMaps, HaveBoundariesAsLines) {
  ArcShape round;
  round.closed = true;
  for (const auto& [x_m, y_m] : {std::pair{2.5, 1.0}, {2.0, 1.5}, {1.5, 1.0}, {2.0, 0.5}}) {
    round.vertices.push_back({{x_m, y_m}, std::tan(0.125 * kPi), 0.01, false});
  }
  Map map;
  map.features.emplace_back().id = 4;
  map.features[0].shape = round;
  const std::vector<LocalMap> maps = local_maps(SplinePath(way()), map, 2.0);
  ASSERT_EQ(maps[0].chains.size(), 1U);
  EXPECT_TRUE(maps[0].chains[0].closed);
  EXPECT_GT(maps[0].chains[0].vertices.size(), 30U);
  const Map back = map_of(maps, SplinePath(way()));
  for (const ChainVertex& vertex : vertices_of(back.features[0])) {
    EXPECT_NEAR((vertex.p_world_m - Eigen::Vector2d(2.0, 1.0)).norm(), 0.5, 1e-9);
  }
}

TEST(LocalMaps, AreAnchoredToThePath) {
  const Pose2 T{{4.0, -2.0}, 1.3};
  Path moved = way();
  for (WayPoint& point : moved.way_points) point.p_world_m = T * point.p_world_m;
  const Map back = map_of(local_maps(SplinePath(way()), things(), 2.0), SplinePath(moved));
  EXPECT_LT((vertices_of(back.features[1])[2].p_world_m - T * Eigen::Vector2d(1.5, 1.2)).norm(), 1e-9);
}

TEST(LocalMaps, SurviveTheirFile) {
  const std::vector<LocalMap> maps = local_maps(SplinePath(way()), things(), 2.0);
  const std::string file = testing::TempDir() + "local_maps.yaml";
  save_local_maps(maps, file);
  const std::vector<LocalMap> read = load_local_maps(file, 3);
  EXPECT_EQ(yaml_text(read), yaml_text(maps));
  ASSERT_EQ(read.size(), maps.size());
  EXPECT_EQ(read[0].chains[1].vertices[0].p_world_m, maps[0].chains[1].vertices[0].p_world_m);
  EXPECT_EQ(read[0].chains[0].first_seen_ns, 1'700'000'000'123'456'789);
  EXPECT_EQ(read[0].chains[0].state, ChainState::kWall);
  EXPECT_EQ(read_local_maps(yaml_text(std::vector<LocalMap>()), 3, "text").size(), 0U);
  std::filesystem::remove(file);
  EXPECT_TRUE(names(refusal_of<std::runtime_error>([&] { save_local_maps(maps, "/no/such/file.yaml"); }),
                    {"/no/such/file.yaml"}));
}

TEST(LocalMaps, RefusalsNameSourcePlaceAndBound) {
  const std::vector<LocalMap> maps = local_maps(SplinePath(way()), things(), 2.0);
  const auto refused = [&](const std::function<void(std::vector<LocalMap>&)>& spoil) {
    std::vector<LocalMap> spoilt = maps;
    spoil(spoilt);
    return refusal_of([&] { read_local_maps(yaml_text(spoilt), 3, "way.yaml"); });
  };
  EXPECT_TRUE(names(refused([](auto& m) { m[2].segment = 3; }), {"way.yaml", "local_maps[2].segment", "3"}));
  EXPECT_TRUE(names(refused([](auto& m) { m[1].segment = 0; }), {"local_maps[1].segment"}));
  EXPECT_TRUE(names(refused([](auto& m) { m[0].chains[1].id = 3; }), {"local_maps[0].chains[1].id"}));
  EXPECT_TRUE(
      names(refused([](auto& m) { m[0].chains[1].p_exists = 2.0; }), {"local_maps[0].chains[1].p_exists", "[0, 1]"}));
  EXPECT_TRUE(
      names(refused([](auto& m) { m[0].chains[0].vertices.resize(1); }), {"local_maps[0].chains[0].vertices", "2"}));
  EXPECT_TRUE(names(refused([](auto& m) { m[0].chains[0].vertices[0].sigma_m = 0.0; }), {"sigma_m", "(0, 100] m"}));
  EXPECT_TRUE(
      names(refused([](auto& m) { m[0].chains[0].first_seen_ns = -1; }), {"local_maps[0].chains[0].first_seen_ns"}));
  const auto text_refused = [](const std::string& yaml) {
    return refusal_of([&] { read_local_maps(yaml, 3, "way.yaml"); });
  };
  EXPECT_TRUE(names(text_refused("local_maps: 3"), {"way.yaml", "local_maps"}));
  EXPECT_TRUE(names(text_refused("local_maps: [{segment: 0, chains: [7]}]"), {"local_maps[0].chains[0]"}));
  EXPECT_TRUE(names(text_refused("local_maps: [{segment: 0}]"), {"local_maps[0].chains"}));
  EXPECT_TRUE(names(text_refused("maps: []"), {"maps"}));
  EXPECT_FALSE(text_refused("local_maps: [").empty());
}

}  // namespace
}  // namespace situation_awareness::local_maps_test

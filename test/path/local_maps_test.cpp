// SPDX-License-Identifier: BSD-3-Clause
#include "situation_awareness/path/local_maps.hpp"

#include <gtest/gtest.h>

#include <filesystem>

#include "situation_awareness/common/random.hpp"
#include "support/refusal.hpp"

namespace situation_awareness::local_maps_test {
namespace {

Path way() { return {false, {{{0.0, 0.0}, {}}, {{4.0, 0.5}, {}}, {{8.0, 0.0}, {}}, {{12.0, -0.5}, {}}}}; }

Polygons things() {
  Polygons polygons;
  const auto add = [&](std::uint64_t id, bool closed, const std::vector<Eigen::Vector2d>& places) {
    Chain chain;
    chain.id = id;
    chain.closed = closed;
    for (const Eigen::Vector2d& place : places) chain.vertices.push_back({place, 0.003 * static_cast<double>(id)});
    chain.first_seen_ns = 1'700'000'000'123'456'789;
    chain.last_seen_ns = chain.first_seen_ns + 5;
    chain.p_exists = 1.0 / 3.0;
    chain.state = ChainState::kKnown;
    polygons.chains.push_back(chain);
  };
  add(3, false, {{-1.0, 1.6}, {13.0, 1.6}});                       // a wall beside all
  add(5, true, {{1.0, 0.8}, {1.5, 0.8}, {1.5, 1.2}, {1.0, 1.2}});  // beside the first
  add(8, true, {{10.0, 5.0}, {11.0, 5.0}, {10.5, 6.0}});           // beside none
  return polygons;
}

TEST(LocalMaps, HaveTheChainsWithinReach) {
  const SplinePath path(way());
  const std::vector<LocalMap> maps = local_maps(path, things(), 2.0);
  ASSERT_EQ(maps.size(), 3U);
  EXPECT_EQ(maps[0].chains.size(), 2U);
  EXPECT_EQ(maps[1].chains.size(), 1U);
  EXPECT_EQ(maps[2].chains.size(), 1U);
  const Polygons back = polygons_of(maps, path);
  ASSERT_EQ(back.chains.size(), 2U) << "each once";
  for (std::size_t i = 0; i < 2; ++i) {
    EXPECT_EQ(back.chains[i].id, things().chains[i].id);
    for (std::size_t k = 0; k < back.chains[i].vertices.size(); ++k) {
      EXPECT_LT((back.chains[i].vertices[k].p_world_m - things().chains[i].vertices[k].p_world_m).norm(), 1e-9);
    }
  }
}

TEST(LocalMaps, AreAnchoredToThePath) {
  const Pose2 T{{4.0, -2.0}, 1.3};
  Path moved = way();
  for (WayPoint& point : moved.way_points) point.p_world_m = T * point.p_world_m;
  const Polygons back = polygons_of(local_maps(SplinePath(way()), things(), 2.0), SplinePath(moved));
  EXPECT_LT((back.chains[1].vertices[2].p_world_m - T * Eigen::Vector2d(1.5, 1.2)).norm(), 1e-9);
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
  EXPECT_EQ(read[0].chains[0].state, ChainState::kKnown);
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

// SPDX-License-Identifier: BSD-3-Clause
#include "situation_awareness/map/polygons/map_file.hpp"

#include <unistd.h>

#include <cmath>
#include <cstdint>
#include <fstream>
#include <functional>
#include <limits>
#include <sstream>
#include <string>
#include <utility>
#include <vector>

#include <gtest/gtest.h>

#include "map/polygons/room_polylines.hpp"
#include "map/polygons/same_chains.hpp"
#include "situation_awareness/map/polygons/polygon_map.hpp"
#include "support/refusal.hpp"

namespace situation_awareness::map_file_test {
namespace {

PolygonMapSnapshot a_snapshot() {
  RoomPolylines room(3);
  room.add_box({{1.5, 1.0}, 0.3, 0.2, 0.15});
  PolygonMap map(PolygonMapParams{});
  for (int i = 0; i < 40; ++i) map.update(room.next(), Eigen::Matrix3d::Zero());
  room.remove_box();
  for (int i = 0; i < 40; ++i) map.update(room.next(), Eigen::Matrix3d::Zero());
  map.polygons();
  PolygonMapSnapshot snapshot = map.snapshot();
  snapshot.world_frame = "map";
  snapshot.height_world_m = 0.25;
  return snapshot;
}

std::string why(const std::function<void()>& act) {
  try {
    act();
  } catch (const std::exception& error) {
    return error.what();
  }
  return "";
}

TEST(PolygonMapFile, ReadsWhatItWrites) {
  const PolygonMapSnapshot snapshot = a_snapshot();
  ASSERT_GT(snapshot.elements.size(), 100U);
  ASSERT_FALSE(snapshot.free_places.values.empty()) << "the box was removed";
  const std::string yaml = polygon_map_to_yaml(snapshot);
  EXPECT_EQ(polygon_map_to_yaml(polygon_map_from_yaml(yaml, "text")), yaml);
  EXPECT_LT(yaml.size(), 600 * snapshot.elements.size() + 200'000);
  const std::string file = testing::TempDir() + "polygons_" + std::to_string(::getpid()) + ".yaml";
  save_polygon_map(file, snapshot);
  EXPECT_EQ(polygon_map_to_yaml(load_polygon_map(file, "map")), yaml);
  EXPECT_NE(why([&] { load_polygon_map(file, "odom"); }).find(file + ": world_frame = map"), std::string::npos);
  ::unlink(file.c_str());
}

TEST(PolygonMapFile, DamageIsRefusedWithTheFilesName) {
  const std::string yaml = polygon_map_to_yaml(a_snapshot());
  for (const std::size_t at : {std::size_t{3}, std::size_t{50}, yaml.size() / 2, yaml.size() - 10}) {
    std::string damaged = yaml;
    damaged[at] = static_cast<char>(damaged[at] ^ 1);
    EXPECT_EQ(why([&] { polygon_map_from_yaml(damaged, "a.yaml"); }).rfind("a.yaml: ", 0), 0U) << at;
    EXPECT_EQ(why([&] { polygon_map_from_yaml(yaml.substr(0, at), "a.yaml"); }).rfind("a.yaml: ", 0), 0U) << at;
  }
}

TEST(PolygonMapFile, InvalidStatesAreRefusedNamingTheField) {
  const PolygonMapSnapshot good = a_snapshot();
  EXPECT_EQ(why([&] { good.validate(); }), "");
  const double nan = std::numeric_limits<double>::quiet_NaN();
  using Spoil = std::function<void(PolygonMapSnapshot&)>;
  const std::vector<std::pair<std::string, Spoil>> faults{
      {"p_world", [&](auto& s) { s.elements[2].p_world_m.x() = nan; }},
      {"p_world", [](auto& s) { s.elements[2].p_world_m.y() = 1e7; }},
      {"normal_world", [](auto& s) { s.elements[2].normal_world *= 0.5; }},
      {"variance_m2", [](auto& s) { s.elements[2].variance_m2 = 0.0; }},
      {"log_odds", [&](auto& s) { s.elements[2].log_odds = nan; }},
      {"low_m", [](auto& s) { s.elements[2].low_m = s.elements[2].high_m + 0.1; }},
      {"hits", [](auto& s) { s.elements[2].hits = -1; }},
      {"place", [](auto& s) { s.elements[9].place = s.elements[0].place; }},
      {"place", [](auto& s) { s.elements[2].place = s.free_places.values[0]; }},
      {"place", [](auto& s) { s.elements[2].place = 1'000'000; }},
      {"place", [](auto& s) { s.elements[2].place = -1; }},
      {"free_places", [](auto& s) { s.free_places.values.push_back(s.free_places.values[0]); }},
      {"free_places", [](auto& s) { s.free_places.values[0] = -1; }},
      {"chain", [](auto& s) { s.elements[2].chain = s.next_id; }},
      {"last_seen_ns", [](auto& s) { s.elements[2].last_seen_ns = s.stamp_ns + 1; }},
      {"first_seen_ns", [](auto& s) { s.elements[2].first_seen_ns = s.stamp_ns + 1; }},
      {"step_s", [](auto& s) { s.step_s = -1.0; }},
      {"next_watch", [](auto& s) { s.next_watch = 8; }},
      {"range_m", [](auto& s) { s.watches[0].range_m.values.pop_back(); }},
      {"range_m", [](auto& s) { s.watches[0].range_m.values[3] = -1.0F; }},
      {"azimuth_rad", [](auto& s) { s.watches[0].azimuth_rad.values[3] = 7.0F; }},
      {"azimuth_rad", [](auto& s) { s.watches[0].azimuth_rad.values.back() = 1e30F; }},
      {"level_world", [&](auto& s) { s.watches[0].T_level_world.yaw_rad = nan; }},
      {"chains", [](auto& s) { s.chains.values[0].elements.push_back(s.free_places.values[0]); }},
      {"chains", [](auto& s) { s.chains.values[0].elements.push_back(s.chains.values[0].elements[0]); }},
      {"chains", [](auto& s) { s.chains.values[0].elements.clear(); }},
      {"chains", [](auto& s) { s.chains.values[0].id = s.next_id; }},
      {"chains",
       [](auto& s) {
         s.chains.values.push_back({s.chains.values[0].id, false, false, 0, {}});
       }},
      {"chains", [](auto& s) { s.chains.values[0].closed = true, s.chains.values[0].elements.resize(2); }},
      {"seldom_hit", [](auto& s) { s.seldom_hit.values.push_back(1'000'000); }},
      {"crossed", [](auto& s) { s.crossed.values.push_back(-1); }},
      {"lines",
       [](auto& s) {
         s.lines.values.insert(s.lines.values.begin(), {s.lines.values[0], -1}), s.lines.values.back() = -2;
       }},
      {"lines",
       [](auto& s) {
         s.lines.values.insert(s.lines.values.begin(), {s.lines.values[1], s.lines.values[2], -1});
       }},
      {"renamed", [](auto& s) { s.renamed.values.push_back(s.free_places.values[0]); }},
      {"met_joints", [](auto& s) { s.met_joints.values.push_back(static_cast<std::int32_t>(s.joints.size())); }},
      {"world_frame", [](auto& s) { s.world_frame = "a b"; }}};
  for (const auto& [field, spoil] : faults) {
    PolygonMapSnapshot bad = good;
    spoil(bad);
    EXPECT_NE(why([&] { polygon_map_to_yaml(bad); }).find(field), std::string::npos)
        << field << ": " << why([&] { polygon_map_to_yaml(bad); });
  }
  PolygonMap map(PolygonMapParams{});
  PolygonMapSnapshot bad = good;
  bad.watches.pop_back();
  bad.next_watch = 0;
  EXPECT_NE(why([&] { map.restore(bad); }).find("watches"), std::string::npos);
}

TEST(PolygonMapFile, RowsOfNumbersAreThoseOfTheText) {
  FloatRow row;
  read_yaml_text("1 2.5 inf -3e-9", row);
  EXPECT_EQ(row.values, (std::vector<float>{1.0F, 2.5F, std::numeric_limits<float>::infinity(), -3e-9F}));
  read_yaml_text("", row);
  EXPECT_TRUE(row.values.empty());
  for (const char* text : {"1  2", "1 ", " 1", "1,2", "a", "1e99"}) {
    EXPECT_THROW(read_yaml_text(text, row), std::invalid_argument) << text;
  }
  PlaceRow places;
  read_yaml_text("3 1 2", places);
  EXPECT_EQ(places.values, (std::vector<std::int32_t>{3, 1, 2}));
  EXPECT_THROW(read_yaml_text("3.5", places), std::invalid_argument);
  ChainRows chains;
  const std::string two = "7 0 0 1 1 2 3 / 0 1 1 4 4 5 6";
  read_yaml_text(two, chains);
  ASSERT_EQ(chains.values.size(), 2U);
  EXPECT_EQ(chains.values[0].id, 7U);
  EXPECT_FALSE(chains.values[0].closed);
  EXPECT_TRUE(chains.values[1].closed);
  EXPECT_EQ(chains.values[1].elements, (std::vector<std::int32_t>{4, 5, 6}));
  EXPECT_EQ(yaml_text(chains), two);
  read_yaml_text("", chains);
  EXPECT_TRUE(chains.values.empty());
  for (const char* text : {"7", "7 0 0 1", "-1 0 0 1 1", "7 2 0 1 1", "7 0 2 1 1", "7 0 0 1 -1", "7 0 0 1 1 /",
                           "7 0 0 1 1 / ", " / 7 0 0 1 1", "7 0 0 1 99999999999"}) {
    EXPECT_THROW(read_yaml_text(text, chains), std::invalid_argument) << text;
  }
}

// Files of the first version have no chains, so all elements are linked anew.
TEST(PolygonMapFile, TheFirstVersionIsReadWithoutChains) {
  PolygonMapSnapshot snapshot = a_snapshot();
  const std::string yaml = polygon_map_to_yaml(snapshot);
  std::string old;
  std::istringstream lines(yaml);
  for (std::string line; std::getline(lines, line);) {
    const auto is_of = [&](const char* name) { return line.rfind(std::string(name) + ": ", 0) == 0; };
    if (is_of("met_joints") || is_of("chains") || is_of("seldom_hit") || is_of("crossed") || is_of("renamed") ||
        is_of("lines"))
      continue;
    old += (is_of("version") ? "version: 1" : is_of("sha256") ? "sha256: edited" : line) + '\n';
  }
  const PolygonMapSnapshot read = polygon_map_from_yaml(old, "text");
  EXPECT_TRUE(read.chains.values.empty());
  PolygonMap map(PolygonMapParams{}), same(PolygonMapParams{});
  map.restore(snapshot);
  same.restore(read);
  const Polygons a = map.polygons(), b = same.polygons();
  ASSERT_FALSE(a.chains.empty());
  ASSERT_EQ(a.chains.size(), b.chains.size());
  for (std::size_t c = 0; c < a.chains.size(); ++c) expect_same(a.chains[c], b.chains[c]);
}

}  // namespace
}  // namespace situation_awareness::map_file_test

// SPDX-License-Identifier: BSD-3-Clause
#include "situation_awareness/map/polygons/geojson.hpp"

#include <unistd.h>

#include <cmath>
#include <cstdint>
#include <cstdlib>
#include <fstream>
#include <functional>
#include <string>
#include <vector>

#include <gtest/gtest.h>
#include <nlohmann/json.hpp>

#include "map/polygons/room_polylines.hpp"
#include "situation_awareness/map/polygons/polygon_map.hpp"
#include "situation_awareness/map/polygons/timed_polygon_map.hpp"

namespace situation_awareness::geojson_test {
namespace {

constexpr std::int64_t kStamp_ns = 1'700'000'000'123'456'789;

Chain square(std::uint64_t id, bool clockwise) {
  Chain chain{id, true, {}, kStamp_ns - 5'000'000'001, kStamp_ns - 7, 0.987654321};
  const std::vector<Eigen::Vector2d> corners{{1.1, 2.0}, {1.1, 3.0}, {2.2, 3.0}, {2.2, 2.0}};
  for (std::size_t i = 0; i < 4; ++i) {
    chain.vertices.push_back({corners[clockwise ? i : (4 - i) % 4], 0.001 * static_cast<double>(i + 1)});
  }
  return chain;
}

Polygons some_chains() {
  Polygons polygons;
  polygons.stamp_ns = kStamp_ns;
  polygons.height_world_m = 0.3;
  polygons.chains = {square(3, true), square(4, false)};
  polygons.chains.push_back(
      {9, false, {{{0.1, 0.2}, 0.01}, {{1.0 / 3.0, -7e-5}, 0.02}, {{-9.25, 1e5}, 0.5}}, 17, kStamp_ns, 1.0});
  polygons.chains.push_back({12, true, {{{0.0, 0.0}, 0.01}, {{1.0, 0.0}, 0.02}}, 17, 18, 0.5});  // there and back
  return polygons;
}

void expect_same_chains(const Polygons& a, const Polygons& b) {
  EXPECT_LE(std::abs(a.stamp_ns - b.stamp_ns), 1000);
  EXPECT_EQ(a.height_world_m, b.height_world_m);
  ASSERT_EQ(a.chains.size(), b.chains.size());
  for (std::size_t i = 0; i < a.chains.size(); ++i) {
    const Chain &x = a.chains[i], &y = b.chains[i];
    EXPECT_EQ(x.id, y.id);
    EXPECT_EQ(x.closed, y.closed);
    EXPECT_LE(std::abs(x.first_seen_ns - y.first_seen_ns), 1000);
    EXPECT_LE(std::abs(x.last_seen_ns - y.last_seen_ns), 1000);
    EXPECT_EQ(x.p_exists, y.p_exists);
    ASSERT_EQ(x.vertices.size(), y.vertices.size());
    for (std::size_t k = 0; k < x.vertices.size(); ++k) {
      EXPECT_EQ(x.vertices[k].p_world_m, y.vertices[k].p_world_m);
      EXPECT_EQ(x.vertices[k].sigma_m, y.vertices[k].sigma_m);
    }
  }
}

TEST(GeoJson, ReadsWhatItWrites) {
  const Polygons polygons = some_chains();
  const std::string text = polygons_to_geojson(polygons, "map");
  expect_same_chains(polygons_from_geojson(text, "text", "map"), polygons);
  const std::string file = testing::TempDir() + "polygons_" + std::to_string(::getpid()) + ".geojson";
  save_geojson(file, polygons, "map");
  save_geojson(file, polygons, "map");  // in the place of one that is there
  expect_same_chains(load_geojson(file, "map"), polygons);
  std::ofstream(file) << "notes";
  EXPECT_THROW(save_geojson(file, polygons, "map"), std::runtime_error) << "no such file: it is not replaced";
  ::unlink(file.c_str());
}

TEST(GeoJson, IsThatOfRfc7946) {
  const auto collection = nlohmann::json::parse(polygons_to_geojson(some_chains(), "map"));
  EXPECT_EQ(collection["type"], "FeatureCollection");
  ASSERT_EQ(collection["features"].size(), 4U);
  EXPECT_EQ(collection["features"][2]["geometry"]["type"], "LineString");
  EXPECT_EQ(collection["features"][3]["geometry"]["type"], "LineString") << "a ring has four positions at least";
  for (const int i : {0, 1}) {
    const auto& feature = collection["features"][static_cast<std::size_t>(i)];
    EXPECT_EQ(feature["type"], "Feature");
    EXPECT_EQ(feature["geometry"]["type"], "Polygon");
    EXPECT_EQ(feature["properties"]["free_side"], i == 0 ? "outside" : "inside");
    const auto& ring = feature["geometry"]["coordinates"][0];
    ASSERT_EQ(ring.size(), 5U);
    EXPECT_EQ(ring.front(), ring.back());
    double area = 0.0;
    for (std::size_t k = 0; k + 1 < ring.size(); ++k) {
      area += 0.5 * (ring[k][0].get<double>() * ring[k + 1][1].get<double>() -
                     ring[k + 1][0].get<double>() * ring[k][1].get<double>());
    }
    EXPECT_NEAR(area, 1.1, 1e-12) << "counter-clockwise";
  }
}

TEST(GeoJson, APlanDrawnByHandNeedsNoProperties) {
  const char* const text = R"({"type": "FeatureCollection", "features": [
    {"type": "Feature", "properties": null, "geometry": {"type": "LineString", "coordinates": [[0, 0], [5, 0, 1.2]]}},
    {"type": "Feature", "geometry": {"type": "Polygon", "coordinates": [[[0, 1], [1, 1], [1, 2], [0, 1]]]}}]})";
  const Polygons polygons = polygons_from_geojson(text, "plan", "map");
  ASSERT_EQ(polygons.chains.size(), 2U);
  EXPECT_EQ(polygons.chains[0].id, 1U);
  EXPECT_EQ(polygons.chains[1].id, 2U);
  EXPECT_EQ(polygons.chains[0].vertices[1].p_world_m, Eigen::Vector2d(5.0, 0.0));
  EXPECT_EQ(polygons.chains[0].vertices[1].sigma_m, 0.02);
  EXPECT_TRUE(polygons.chains[1].closed);
  EXPECT_EQ(polygons.chains[1].vertices[1].p_world_m, Eigen::Vector2d(1.0, 2.0)) << "clockwise: free outside";
}

TEST(GeoJson, WhatIsNoneIsRefusedWithTheReason) {
  const auto why = [](const std::string& text) -> std::string {
    try {
      polygons_from_geojson(text, "a.geojson", "map");
    } catch (const std::invalid_argument& error) {
      return error.what();
    }
    return "";
  };
  const std::string good = polygons_to_geojson(some_chains(), "map");
  EXPECT_EQ(why(good), "");
  using Json = nlohmann::json;
  const std::vector<std::pair<std::string, std::function<void(Json&)>>> faults{
      {"is no FeatureCollection", [](Json& j) { j["type"] = "Feature"; }},
      {"features is missing", [](Json& j) { j.erase("features"); }},
      {"world_frame = odom is not", [](Json& j) { j["world_frame"] = "odom"; }},
      {"world_frame is no text", [](Json& j) { j["world_frame"] = 3; }},
      {"stamp is no number", [](Json& j) { j["stamp"] = "now"; }},
      {"features[1]: is no Feature", [](Json& j) { j["features"][1] = 5; }},
      {"features[2]: geometry is missing", [](Json& j) { j["features"][2].erase("geometry"); }},
      {"neither a LineString nor a Polygon", [](Json& j) { j["features"][0]["geometry"]["type"] = "Point"; }},
      {"has not one ring", [](Json& j) { j["features"][0]["geometry"]["coordinates"] = Json::array(); }},
      {"does not end where it begins", [](Json& j) { j["features"][0]["geometry"]["coordinates"][0][0][0] = 55.0; }},
      {"fewer than two positions",
       [](Json& j) {
         j["features"][2]["geometry"]["coordinates"] = {{1.0, 2.0}};
       }},
      {"has not two coordinates", [](Json& j) { j["features"][2]["geometry"]["coordinates"][0] = {1.0}; }},
      {"a coordinate is out of bounds", [](Json& j) { j["features"][2]["geometry"]["coordinates"][0][0] = 1e9; }},
      {"a coordinate is no number", [](Json& j) { j["features"][2]["geometry"]["coordinates"][0][0] = nullptr; }},
      {"features[0]: id is no whole number", [](Json& j) { j["features"][0]["properties"]["id"] = -1; }},
      {"id 4 is there twice", [](Json& j) { j["features"][0]["properties"]["id"] = 4; }},
      {"sigma_m has not one number for each", [](Json& j) { j["features"][0]["properties"]["sigma_m"] = {0.1}; }},
      {"sigma_m is out of bounds", [](Json& j) { j["features"][0]["properties"]["sigma_m"][1] = 0.0; }},
      {"p is out of bounds", [](Json& j) { j["features"][0]["properties"]["p"] = 1.5; }},
      {"closed is neither", [](Json& j) { j["features"][0]["properties"]["closed"] = "yes"; }},
      {"free_side is neither", [](Json& j) { j["features"][0]["properties"]["free_side"] = "left"; }},
      {"first_seen is after last_seen", [](Json& j) { j["features"][0]["properties"]["first_seen"] = 1.8e9; }},
      {"last_seen is after", [](Json& j) { j["features"][0]["properties"]["last_seen"] = 1.8e9; }},
      {"properties are none", [](Json& j) { j["features"][0]["properties"] = 4; }}};
  for (const auto& [reason, spoil] : faults) {
    Json bad = Json::parse(good);
    spoil(bad);
    const std::string said = why(bad.dump());
    EXPECT_EQ(said.rfind("a.geojson: ", 0), 0U) << said;
    EXPECT_NE(said.find(reason), std::string::npos) << said << ", not: " << reason;
  }
  for (const std::size_t size : {std::size_t{0}, std::size_t{20}, good.size() / 2, good.size() - 3}) {
    EXPECT_NE(why(good.substr(0, size)).find("not valid GeoJSON"), std::string::npos);
  }
}

// A room that was measured before: its map begins with it, and hits are on it.
TEST(GeoJson, AMapBeginsWithItsChains) {
  Polygons plan;
  plan.stamp_ns = 1'000'000'000'000;
  Chain room{5, true, {}, plan.stamp_ns, plan.stamp_ns, 0.9975};
  for (const auto& [x, y] : {std::pair{3.0, 2.0}, {-3.0, 2.0}, {-3.0, -2.0}, {3.0, -2.0}}) {
    room.vertices.push_back({{x, y}, 0.01});
  }
  plan.chains = {room};
  const Polygons read = polygons_from_geojson(polygons_to_geojson(plan, "map"), "plan", "map");
  TimedPolygonMap map(PolygonMapParams{}, {}, 1.0);
  map.resume(snapshot_of_chains(read, 0.04));
  ASSERT_EQ(map.size(), 1U);
  const Chain& chain = map.polygons().chains[0];
  EXPECT_EQ(chain.id, 5U);
  EXPECT_TRUE(chain.closed);
  ASSERT_EQ(chain.vertices.size(), 4U);
  for (const ChainVertex& vertex : chain.vertices) {
    EXPECT_NEAR(std::abs(vertex.p_world_m.x()), 3.0, 1e-6);
    EXPECT_NEAR(std::abs(vertex.p_world_m.y()), 2.0, 1e-6);
  }
  RoomPolylines scans(1, plan.stamp_ns + 60'000'000'000);
  const PolygonMapUpdate update = map.update(scans.next(), Eigen::Matrix3d::Zero());
  EXPECT_LT(update.created, 3);
  EXPECT_GT(update.fused, 700);
  ASSERT_EQ(map.size(), 1U);
  EXPECT_EQ(map.polygons().chains[0].id, 5U);
}

}  // namespace
}  // namespace situation_awareness::geojson_test

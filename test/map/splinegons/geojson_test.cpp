// SPDX-License-Identifier: BSD-3-Clause
#include "situation_awareness/map/splinegons/geojson.hpp"

#include <algorithm>
#include <cstdint>
#include <stdexcept>
#include <string>
#include <utility>
#include <vector>

#include <gtest/gtest.h>
#include <nlohmann/json.hpp>

#include "map/splinegons/outlines.hpp"

namespace situation_awareness::geojson_test {
namespace {

constexpr std::int64_t kStamp_ns = 1'700'000'000'123'456'000;

Splinegons some_boundaries() {
  Splinegons splinegons;
  splinegons.stamp_ns = kStamp_ns;
  Random random(1);
  SplinegonFit fit{SplinegonFitParams()};
  std::uint64_t id = 3;
  for (const bool closed : {true, false}) {
    Splinegon splinegon{id++, closed, {}, kStamp_ns - 5'000'000'000, kStamp_ns - 7000};
    fit.fit(elements_of(box_outline(), 0.15, 0.01, random, 0.0, closed ? 1.0 : 0.6), closed, 1e-4, splinegon.vertices);
    splinegons.boundaries.push_back(splinegon);
  }
  return splinegons;
}

TEST(SplinegonGeoJson, IsReadBackExactly) {
  const Splinegons written = some_boundaries();
  const Splinegons read = splinegons_from_geojson(splinegons_to_geojson(written, "map"), "here", "map");
  EXPECT_NEAR(static_cast<double>(read.stamp_ns - written.stamp_ns), 0.0, 1000.0);
  ASSERT_EQ(read.boundaries.size(), written.boundaries.size());
  for (std::size_t i = 0; i < read.boundaries.size(); ++i) {
    const Splinegon &a = written.boundaries[i], &b = read.boundaries[i];
    EXPECT_EQ(a.id, b.id);
    EXPECT_EQ(a.closed, b.closed);
    EXPECT_NEAR(static_cast<double>(a.first_seen_ns - b.first_seen_ns), 0.0, 1000.0);
    ASSERT_EQ(a.vertices.size(), b.vertices.size());
    for (std::size_t k = 0; k < a.vertices.size(); ++k) {
      EXPECT_EQ(a.vertices[k].p_world_m, b.vertices[k].p_world_m);
      EXPECT_EQ(a.vertices[k].bulge, b.vertices[k].bulge);
      EXPECT_EQ(a.vertices[k].sigma_m, b.vertices[k].sigma_m);
      EXPECT_EQ(a.vertices[k].corner, b.vertices[k].corner);
    }
  }
}

TEST(SplinegonGeoJson, ADrawnPolygonHasCorners) {
  const std::string text = R"({"type": "FeatureCollection", "features": [{"type": "Feature", "geometry":
      {"type": "Polygon", "coordinates": [[[0, 0], [4, 0], [4, 3], [0, 0]]]}}]})";
  const Splinegons splinegons = splinegons_from_geojson(text, "here", "map");
  ASSERT_EQ(splinegons.boundaries.size(), 1U);
  const Splinegon& triangle = splinegons.boundaries[0];
  EXPECT_EQ(triangle.id, 1U);
  EXPECT_TRUE(triangle.closed);
  EXPECT_EQ(triangle.vertices.size(), 6U);
  EXPECT_TRUE(triangle.vertices[0].corner);
  EXPECT_FALSE(triangle.vertices[1].corner);
  EXPECT_NEAR(area_m2(triangle), 6.0, 1e-12);
  EXPECT_NEAR(length_m(triangle), 12.0, 1e-12);
}

TEST(SplinegonGeoJson, RefusesWhatIsNone) {
  const nlohmann::json valid = nlohmann::json::parse(splinegons_to_geojson(some_boundaries(), "map"));
  const std::vector<std::pair<std::string, nlohmann::json>> changes{
      {"/type", "Feature"},
      {"/world_frame", "odom"},
      {"/stamp", -5},
      {"/features", 3},
      {"/features/0/type", "Polygon"},
      {"/features/0/geometry/type", "Point"},
      {"/features/0/geometry/coordinates/0/0", nlohmann::json::array({1.0, 2.0})},  // does not end where it begins
      {"/features/0/geometry/coordinates/0/1/0", 1e7},
      {"/features/0/geometry/coordinates/0/1", "x"},
      {"/features/0/properties/id", 0},
      {"/features/0/properties/id", 4},  // there twice
      {"/features/0/properties/bulge/2", "x"},
      {"/features/0/properties/bulge", nlohmann::json::array({0.1})},
      {"/features/0/properties/sigma_m/0", -1.0},
      {"/features/0/properties/corner/0", 1},
      {"/features/0/properties/last_seen", 4e9}};
  EXPECT_NO_THROW(splinegons_from_geojson(valid.dump(), "here", "map"));
  for (const auto& [place, value] : changes) {
    nlohmann::json changed = valid;
    changed[nlohmann::json::json_pointer(place)] = value;
    EXPECT_THROW(splinegons_from_geojson(changed.dump(), "here", "map"), std::invalid_argument) << place;
  }
  nlohmann::json clockwise = valid;
  auto& ring = clockwise["/features/0/geometry/coordinates/0"_json_pointer];
  std::reverse(ring.begin(), ring.end());
  EXPECT_THROW(splinegons_from_geojson(clockwise.dump(), "here", "map"), std::invalid_argument);
  EXPECT_THROW(splinegons_from_geojson("{", "here", "map"), std::invalid_argument);
}

}  // namespace
}  // namespace situation_awareness::geojson_test

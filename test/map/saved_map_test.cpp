// SPDX-License-Identifier: BSD-3-Clause
#include "situation_awareness/map/saved_map.hpp"

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <functional>
#include <stdexcept>
#include <string>
#include <utility>
#include <variant>
#include <vector>

#include <gtest/gtest.h>

#include "situation_awareness/common/random.hpp"
#include "situation_awareness/geometry/angles.hpp"
#include "situation_awareness/map/feature_json.hpp"
#include "support/refusal.hpp"

namespace situation_awareness::saved_map_test {
namespace {

/// This stamp loses no digit when it is written in seconds.
constexpr std::int64_t kStamp_ns = 64'500'000'000;

BodyState some_body(Random& random) {
  BodyState body;
  body.velocity_world_m_s = {random.normal(), random.normal()};
  body.angular_velocity_rad_s = random.normal();
  Matrix8d A;
  for (int i = 0; i < 64; ++i) A(i / 8, i % 8) = 0.1 * random.normal();
  body.covariance = A * A.transpose();
  return body;
}

SavedMap some_map(std::uint64_t seed) {
  Random random(seed);
  const auto place = [&] { return Eigen::Vector2d(random.uniform(-1e5, 1e5), random.uniform(-10.0, 10.0)); };
  SavedMap saved;
  saved.world_frame = "map";
  saved.next_id = (FeatureId{7} << IdSource::kCounterBits) + 100;
  saved.map.stamp_ns = kStamp_ns;
  saved.map.height_world_m = random.normal();
  const double radius_m = random.uniform(2.0, 20.0);
  const Eigen::Vector2d center_m = place();
  ArcShape circle;
  for (int k = 0; k < 4; ++k) {
    const double angle_rad = 0.5 * kPi * k;
    circle.vertices.push_back({center_m + radius_m * Eigen::Vector2d(std::cos(angle_rad), std::sin(angle_rad)),
                               std::tan(kPi / 8.0), random.uniform(0.0, 0.1), false});
  }
  circle.closed = true;
  const std::vector<FeatureShape> shapes{
      EllipseShape{{place(), 0.3, 0.5, 0.25}, some_body(random)},
      BoxShape{{place(), -1.2, 2.25, 0.9}, some_body(random)},
      PolylineShape{{{place(), 0.01}, {place(), 0.02}, {place(), 0.0}}, random.uniform() < 0.5}, circle,
      FootprintShape{{1.5, -2.25, 408.125}, 0.09 * Eigen::Matrix2d::Identity(), 7.5}};
  for (std::size_t i = 0; i < shapes.size(); ++i) {
    Feature& feature = saved.map.features.emplace_back();
    feature.id = (FeatureId{7} << IdSource::kCounterBits) + 10 + i;
    feature.object_class = static_cast<ObjectClass>(i % 4);
    feature.p_class = random.uniform();
    feature.p_exists = random.uniform();
    feature.p_moving = random.uniform();
    feature.motion = static_cast<Motion>(i % 3);
    feature.first_seen_ns = kStamp_ns - 9'000'000'000;
    feature.last_seen_ns = kStamp_ns - 2'000'000'000;
    if (i == 1) feature.last_absent_ns = kStamp_ns - 20'000'000'000;
    if (i == 2) feature.first_absent_ns = kStamp_ns - 1'000'000'000;
    feature.seen_by = {i != 4, i == 0, i == 4, false, i == 2};
    feature.shape = shapes[i];
  }
  return saved;
}

/// All but the members of boxes that are rounded on their way.
std::string text_without_boxes(const SavedMap& saved) {
  SavedMap others = saved;
  for (Feature& feature : others.map.features) {
    if (auto* const box = std::get_if<BoxShape>(&feature.shape))
      box->box_world.half_length_m = box->box_world.half_width_m = 1.0;
  }
  return map_to_json(others);
}

TEST(SavedMap, IsReadAsItWasWritten) {
  for (std::uint64_t seed = 1; seed <= 20; ++seed) {
    const SavedMap saved = some_map(seed);
    const SavedMap read = map_from_json(map_to_json(saved), "text", "map");
    EXPECT_EQ(text_without_boxes(read), text_without_boxes(saved));
    ASSERT_EQ(read.map.features.size(), saved.map.features.size());
    const Box& box = std::get<BoxShape>(read.map.features[1].shape).box_world;
    EXPECT_NEAR(box.half_length_m, 2.25, 1e-12);
    EXPECT_NEAR(box.half_width_m, 0.9, 1e-12);
  }
}

TEST(SavedMap, TimesLoseLessThanAMicrosecond) {
  SavedMap saved = some_map(1);
  const std::int64_t later_ns = 1'700'000'000'123'456'789;
  saved.map.stamp_ns += later_ns;
  for (Feature& feature : saved.map.features) {
    feature.first_seen_ns += later_ns;
    feature.last_seen_ns = saved.map.stamp_ns;
  }
  const Map read = map_from_json(map_to_json(saved), "text", "map").map;
  EXPECT_LT(std::abs(read.stamp_ns - saved.map.stamp_ns), 1000);
  for (std::size_t i = 0; i < read.features.size(); ++i) {
    EXPECT_LT(std::abs(read.features[i].first_seen_ns - saved.map.features[i].first_seen_ns), 1000);
    EXPECT_LT(std::abs(read.features[i].last_seen_ns - saved.map.features[i].last_seen_ns), 1000);
  }
}

TEST(SavedMap, APlanDrawnByHandNeedsKindsAndOutlines) {
  const SavedMap read = map_from_json(R"({"format": "situation_awareness features", "version": 1, "world_frame": "map",
    "stamp": 5, "height": 0, "next_id": 1, "features": [
    {"kind": "polyline", "outline": [[0, 0], [4, 0], [4, 3]]},
    {"kind": "box", "x": 1, "y": 2, "rx": 1.2, "ry": 0.5, "id": 7, "class": "vehicle", "motion": "standing"},
    {"kind": "target", "x": 1, "y": 2, "area_m2": 8}]})",
                                      "plan", "map");
  ASSERT_EQ(read.map.features.size(), 3U);
  EXPECT_EQ(read.map.features[0].id, 7U);
  EXPECT_EQ(read.map.features[1].id, 8U);
  EXPECT_EQ(read.next_id, 10U);
  const Feature& wall = read.map.features[1];
  EXPECT_EQ(wall.motion, Motion::kFixed);
  EXPECT_EQ(wall.p_exists, 1.0);
  EXPECT_EQ(wall.first_seen_ns, 5'000'000'000);
  EXPECT_TRUE(wall.seen_by.file);
  EXPECT_EQ(std::get<PolylineShape>(wall.shape).vertices[2].sigma_m, 0.02);
}

TEST(SavedMap, WhatIsNoneIsRefusedByName) {
  const SavedMap good = some_map(1);
  using Spoil = std::function<void(Json&)>;
  const std::vector<std::pair<Spoil, std::string>> faults{
      {[](Json& map) { map["format"] = "other"; }, "format"},
      {[](Json& map) { map["version"] = 2; }, "version"},
      {[](Json& map) { map["world_frame"] = "odom"; }, "odom"},
      {[](Json& map) { map.erase("stamp"); }, "stamp"},
      {[](Json& map) { map["height"] = 1e9; }, "height"},
      {[](Json& map) { map["features"] = 3; }, "features"},
      {[](Json& map) { map["features"][1] = 3; }, "features[1]"},
      {[](Json& map) { map["features"][1]["id"] = map["features"][0]["id"]; }, "twice"},
      {[](Json& map) { map["features"][1]["id"] = -1; }, "features[1]: id"},
      {[](Json& map) { map["features"][1]["kind"] = "house"; }, "features[1]: kind = \"house\""},
      {[](Json& map) { map["features"][1]["class"] = "tree"; }, "features[1]: class"},
      {[](Json& map) { map["features"][1]["p_exists"] = 1.5; }, "features[1]: p_exists"},
      {[](Json& map) { map["features"][1]["last_seen"] = 3e9; }, "features[1]: last_seen"},
      {[](Json& map) { map["features"][1]["first_seen"] = 3e9; }, "features[1]: first_seen"},
      {[](Json& map) { map["features"][0]["rx"] = 0.1; }, "features[0]: ry"},
      {[](Json& map) { map["features"][0]["covariance"][0] = -1.0; }, "features[0]: covariance"},
      {[](Json& map) { map["features"][0]["covariance"].erase(3); }, "features[0]: covariance"},
      {[](Json& map) { map["features"][2]["outline"] = Json::array(); }, "features[2]: "},
      {[](Json& map) { map["features"][2]["outline"][0] = Json::array({1}); }, "features[2]: outline"},
      {[](Json& map) { map["features"][2]["outline"][0][0] = "far"; }, "features[2]: outline"},
      {[](Json& map) { map["features"][2]["sigma_m"].erase(0); }, "features[2]: sigma_m"},
      {[](Json& map) { map["features"][3]["outline"].erase(0); }, "features[3]: "},
      {[](Json& map) {
         std::reverse(map["features"][3]["outline"].begin(), map["features"][3]["outline"].end());
         for (Json& point : map["features"][3]["outline"]) point[2] = -point[2].get<double>();
       },
       "features[3]: outline is not counter-clockwise"},
      {[](Json& map) { map["features"][4]["area_m2"] = 0.0; }, "features[4]: area_m2"}};
  for (const auto& [spoil, name] : faults) {
    Json map = Json::parse(map_to_json(good));
    spoil(map);
    EXPECT_TRUE(names(refusal_of([&] { map_from_json(map.dump(), "map.json", "map"); }), {"map.json: ", name})) << name;
  }
  for (const std::string text : {"", "no map", "[]", "{\"format\": 3}"}) {
    EXPECT_TRUE(names(refusal_of([&] { map_from_json(text, "map.json", ""); }), {"map.json: "})) << text;
  }
  const std::string text = map_to_json(good);
  for (std::size_t length = 0; length < text.size() - 2; length += 97) {
    EXPECT_THROW(map_from_json(text.substr(0, length), "cut", ""), std::invalid_argument);
  }
}

}  // namespace
}  // namespace situation_awareness::saved_map_test

// SPDX-License-Identifier: BSD-3-Clause
#include "situation_awareness/pose/reflector_map.hpp"

#include <gtest/gtest.h>

#include <string>

#include "situation_awareness/common/random.hpp"
#include "support/refusal.hpp"

namespace situation_awareness::reflector_map_test {
namespace {

std::string refused(const std::string& yaml) {
  return refusal_of([&] { read_reflector_map(yaml, "hall.yaml"); });
}

std::string entry(const std::string& x, const std::string& y, const std::string& radius_m) {
  return "{x: " + x + ", y: " + y + ", radius_m: " + radius_m + "}";
}

TEST(ReflectorMap, IsReadFromYaml) {
  const ReflectorMap map = read_reflector_map("reflectors: [" + entry("1.5", "-2", "0.05") + "]", "hall.yaml");
  ASSERT_EQ(map.reflectors.size(), 1U);
  EXPECT_EQ(map.reflectors[0].center_world_m, Eigen::Vector2d(1.5, -2.0));
  EXPECT_EQ(map.reflectors[0].radius_m, 0.05);
}

TEST(ReflectorMap, ReadsBackExactlyWhatItWrites) {
  Random random(1);
  ReflectorMap map;
  for (int i = 0; i < 50; ++i) {
    map.reflectors.push_back({{3.0 * i + random.uniform(), random.uniform(-1e3, 1e3)}, random.uniform(0.01, 1.0)});
  }
  const ReflectorMap read = read_reflector_map(yaml_text(map), "text");
  ASSERT_EQ(read.reflectors.size(), map.reflectors.size());
  for (std::size_t i = 0; i < map.reflectors.size(); ++i) {
    EXPECT_EQ(read.reflectors[i].center_world_m, map.reflectors[i].center_world_m);
    EXPECT_EQ(read.reflectors[i].radius_m, map.reflectors[i].radius_m);
  }
}

TEST(ReflectorMap, RefusalsNameSourceIndexFieldAndBound) {
  const std::string good = entry("0", "0", "0.05");
  EXPECT_TRUE(names(refused("reflectors: [" + good + ", {x: 1, y: 2}]"), {"hall.yaml", "reflectors[1].radius_m"}));
  EXPECT_TRUE(
      names(refused("reflectors: [" + entry(".nan", "0", "0.05") + "]"), {"reflectors[0].x", "[-1e+06, 1e+06] m"}));
  EXPECT_TRUE(names(refused("reflectors: [" + entry("0", ".inf", "0.05") + "]"), {"reflectors[0].y"}));
  EXPECT_TRUE(names(refused("reflectors: [" + entry("0", "0", "0") + "]"), {"reflectors[0].radius_m", "(0, 1] m"}));
  EXPECT_TRUE(names(refused("reflectors: [" + entry("0", "0", "1.01") + "]"), {"reflectors[0].radius_m", "1.01"}));
  EXPECT_TRUE(names(refused("reflectors: [" + entry("a", "0", "1") + "]"), {"reflectors[0].x", "number"}));
  EXPECT_TRUE(names(refused("reflectors: [{x: 0, y: 0, radius_m: 0.1, z: 1}]"), {"reflectors[0]", "z"}));
  EXPECT_TRUE(names(refused("reflectors: [{x: 0, x: 1, y: 0, radius_m: 0.1}]"), {"hall.yaml", "reflectors[0].x"}));
  EXPECT_TRUE(names(refused("reflectors: [" + good + ", " + entry("0.09", "0", "0.05") + "]"),
                    {"reflectors[0]", "reflectors[1]", "0.1"}));
  EXPECT_TRUE(names(refused("reflectors: []"), {"hall.yaml", "reflectors"}));
  EXPECT_TRUE(names(refused("reflectors: 3"), {"hall.yaml", "reflectors"}));
  EXPECT_TRUE(names(refused("reflectors: [4]"), {"reflectors[0]"}));
  EXPECT_TRUE(names(refused("landmarks: []"), {"hall.yaml", "reflectors"}));
  EXPECT_TRUE(names(refused("{reflectors: [" + good + "], more: 1}"), {"reflectors"}));
  EXPECT_TRUE(names(refused("{reflectors: [" + good + "], reflectors: [" + good + "]}"), {"hall.yaml", "reflectors"}));
  EXPECT_TRUE(
      names(refused("reflectors: [" + good + ", " + good + "]"), {"reflectors[0]", "reflectors[1]", "overlap"}));
  EXPECT_TRUE(names(refused("reflectors: [" + entry("-", "0", "0.05") + "]"), {"reflectors[0].x", "number"}));
  EXPECT_TRUE(names(refused("reflectors: [" + entry("0", "[1]", "0.05") + "]"), {"reflectors[0].y", "number"}));
  EXPECT_TRUE(names(refused("reflectors:"), {"hall.yaml", "reflectors"}));
  EXPECT_FALSE(refused("reflectors: [").empty());
  EXPECT_FALSE(refused("").empty());
  EXPECT_TRUE(names(refusal_of([] { load_reflector_map("/no/such.yaml"); }), {"/no/such.yaml"}));
}

}  // namespace
}  // namespace situation_awareness::reflector_map_test

// SPDX-License-Identifier: BSD-3-Clause
#include "situation_awareness/path/path.hpp"

#include <gtest/gtest.h>

#include <string>

#include "situation_awareness/common/random.hpp"
#include "situation_awareness/path/spline_path.hpp"
#include "support/refusal.hpp"

namespace situation_awareness::path_test {
namespace {

std::string refused(const std::string& yaml) {
  return refusal_of([&] { read_path(yaml, "hall.yaml"); });
}

TEST(Path, IsReadFromYaml) {
  const Path path = read_path("path: [{x: 1.5, y: -2}, {x: 3, y: 1, speed_m_s: 0.25}]", "hall.yaml");
  EXPECT_FALSE(path.closed);
  ASSERT_EQ(path.way_points.size(), 2U);
  EXPECT_EQ(path.way_points[0].p_world_m, Eigen::Vector2d(1.5, -2.0));
  EXPECT_FALSE(path.way_points[0].speed_m_s);
  EXPECT_EQ(path.way_points[1].speed_m_s, 0.25);
  EXPECT_TRUE(read_path("{closed: true, path: [{x: 0, y: 0}, {x: 1, y: 0}, {x: 0, y: 1}]}", "a").closed);
}

Path random_path(Random& random, bool closed) {
  Path path{closed, {}};
  for (int i = 0; i < 20; ++i) {
    path.way_points.push_back({{3.0 * i + random.uniform(), random.uniform(-1.0, 1.0)}, {}});
    if (random.uniform() < 0.3) path.way_points.back().speed_m_s = random.uniform(0.1, 1.0);
  }
  return path;
}

TEST(Path, ReadsBackExactlyWhatItWrites) {
  Random random(1);
  for (const bool closed : {false, true}) {
    const Path path = random_path(random, closed);
    const Path read = read_path(yaml_text(path), "text");
    EXPECT_EQ(read.closed, closed);
    ASSERT_EQ(read.way_points.size(), path.way_points.size());
    for (std::size_t i = 0; i < path.way_points.size(); ++i) {
      EXPECT_EQ(read.way_points[i].p_world_m, path.way_points[i].p_world_m);
      EXPECT_EQ(read.way_points[i].speed_m_s, path.way_points[i].speed_m_s);
    }
  }
}

TEST(Path, TheWayBackHasTheSamePlacesBendsAndSpeeds) {
  Random random(2);
  for (const bool closed : {false, true}) {
    const Path path = random_path(random, closed);
    const SplinePath there(path), back(reversed(path));
    ASSERT_NEAR(there.length_m(), back.length_m(), 1e-9);
    // The way back of a closed path begins at its last way point.
    const double first_m = closed ? there.begin_m(there.segments() - 1) : there.length_m();
    for (double way_m = 0.013; way_m < back.length_m(); way_m += 0.31) {
      const PathPoint a = there.at(first_m - way_m), b = back.at(way_m);
      EXPECT_LT((a.p_world_m - b.p_world_m).norm(), 1e-7);
      EXPECT_NEAR(a.curvature_1_m, -b.curvature_1_m, 1e-6);
      EXPECT_EQ(there.speed_m_s(a.segment).value_or(100.0), back.speed_m_s(b.segment).value_or(100.0));
    }
  }
}

TEST(Path, RefusalsNameSourceIndexFieldAndBound) {
  EXPECT_TRUE(names(refused("path: [{x: 0, y: 0}, {x: 1}]"), {"hall.yaml", "path[1].y"}));
  EXPECT_TRUE(names(refused("path: [{x: .nan, y: 0}, {x: 1, y: 0}]"), {"path[0].x", "[-1e+06, 1e+06] m"}));
  EXPECT_TRUE(names(refused("path: [{x: 0, y: -.inf}, {x: 1, y: 0}]"), {"path[0].y"}));
  EXPECT_TRUE(
      names(refused("path: [{x: 0, y: 0, speed_m_s: 0}, {x: 1, y: 0}]"), {"path[0].speed_m_s", "(0, 100] m/s"}));
  EXPECT_TRUE(names(refused("path: [{x: a, y: 0}, {x: 1, y: 0}]"), {"path[0].x", "number"}));
  EXPECT_TRUE(names(refused("path: [{x: 0, y: 0, z: 1}, {x: 1, y: 0}]"), {"path[0]", "z"}));
  EXPECT_TRUE(names(refused("path: [{x: 0, x: 1, y: 0}, {x: 1, y: 0}]"), {"path[0].x"}));
  EXPECT_TRUE(names(refused("path: [{x: 0, y: 0}, {x: 0.001, y: 0}]"), {"path[0]", "path[1]", "0.01"}));
  EXPECT_TRUE(names(refused("path: [{x: 0, y: 0}]"), {"hall.yaml", "path", "2"}));
  EXPECT_TRUE(names(refused("{closed: true, path: [{x: 0, y: 0}, {x: 1, y: 1}]}"), {"path", "3"}));
  EXPECT_TRUE(names(refused("{closed: 7, path: [{x: 0, y: 0}, {x: 1, y: 1}]}"), {"closed"}));
  EXPECT_TRUE(names(refused("path: 3"), {"hall.yaml", "path"}));
  EXPECT_TRUE(names(refused("path: [4, 5]"), {"path[0]"}));
  EXPECT_TRUE(names(refused("way: []"), {"hall.yaml", "path"}));
  EXPECT_TRUE(names(refused("{path: [{x: 0, y: 0}, {x: 1, y: 1}], more: 1}"), {"path", "closed"}));
  const std::string good = "[{x: 0, y: 0}, {x: 1, y: 1}]";
  EXPECT_EQ(refused("path: " + good), "");
  EXPECT_TRUE(names(refused("{path: " + good + ", path: " + good + "}"), {"hall.yaml", "path"}));
  EXPECT_TRUE(names(refused("{closed: true, closed: false, path: " + good + "}"), {"hall.yaml", "closed"}));
  EXPECT_TRUE(names(refused("path: []"), {"hall.yaml", "path", "2"}));
  EXPECT_TRUE(names(refused("path:"), {"hall.yaml", "path"}));
  EXPECT_TRUE(names(refused("path: [{x: -, y: 0}, {x: 1, y: 1}]"), {"path[0].x", "number"}));
  EXPECT_FALSE(refused("path: [").empty());
  EXPECT_FALSE(refused("").empty());
  EXPECT_TRUE(names(refusal_of([] { load_path("/no/such.yaml"); }), {"/no/such.yaml"}));
}

}  // namespace
}  // namespace situation_awareness::path_test

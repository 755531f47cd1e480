// SPDX-License-Identifier: BSD-3-Clause
// Bodies that appear and go.
#include <algorithm>
#include <cmath>
#include <string>
#include <vector>

#include <gtest/gtest.h>

#include "sim/world_file.hpp"
#include "situation_awareness/sim/scan_simulation.hpp"

namespace situation_awareness::presence_test {
namespace {

/// A wall 6 m ahead, and before it a post that appears at 0.5 s and goes at 1 s, a crate that is scenery and goes at
/// 0.25 s, and a walker with a bag who appears at 0.75 s.
const std::string kComingAndGoing =
    world_text(kRobot + R"(<geom type="box" pos="6.5 0 1.5" size="0.5 8 1.5"/>
                <body name="crate" pos="3 -2 1.5"><geom type="box" size="0.5 0.5 1.5"/></body>)" +
                   object_text("post", "pos=\"3 0 1\"", "0.3 0.3 1") +
                   object_text("walker", "mocap=\"true\" pos=\"3 2 1\"", "0.3 0.3 1") +
                   object_text("bag", "mocap=\"true\" pos=\"3 2 1\"", "0.1 0.1 1"),
               R"(<text name="crate" data="stand goes 0.25"/> <text name="post" data="stand appears 0.5 goes 1"/>
       <text name="walker" data="straight from 3 2 velocity 0 0.5 appears 0.75"/>
       <text name="bag" data="with walker at 0 1"/>)");

/// Numbers of beams that ended before the wall, left (walker), ahead (post) and right (crate).
std::vector<int> hits_before_the_wall(const Scan& scan) {
  std::vector<int> hits(3, 0);
  for (std::size_t i = 0; i < scan.beams.size(); ++i) {
    const double angle = scan.angle_min_rad + static_cast<double>(i) * scan.angle_increment_rad;
    const Beam& beam = scan.beams[i];
    const double x = beam.range_m * std::cos(angle), y = beam.range_m * std::sin(angle);
    if (beam.state == BeamState::kHit && x < 5.0) ++hits[y > 1.0 ? 0 : y > -1.0 ? 1 : 2];
  }
  return hits;
}

TEST(Presence, AbsentBodiesAreNeitherSeenNorInTheTruth) {
  const WorldFile file(kComingAndGoing);
  ScanSimulation simulation(file.path(), {}, 1);
  ASSERT_EQ(simulation.world().names(), (std::vector<std::string>{"post", "walker", "bag"}));
  for (int scan = 0; scan < 30; ++scan) {
    const double t = scan / 20.0;
    const bool post = t >= 0.5 && t < 1.0, walker = t >= 0.75, crate = t < 0.25;
    const SimulatedScan simulated = simulation.next();
    const std::vector<int> hits = hits_before_the_wall(simulated.scan);
    EXPECT_EQ(hits[0] > 20, walker) << t;
    EXPECT_EQ(hits[1] > 20, post) << t;
    EXPECT_EQ(hits[2] > 20, crate) << t;
    EXPECT_EQ(hits[0] == 0, !walker) << t;
    EXPECT_EQ(hits[1] == 0, !post) << t;
    EXPECT_EQ(hits[2] == 0, !crate) << t;
    const std::vector<bool> is_there = {post, walker, walker};
    const std::vector<TrueObject> objects = simulation.world().objects_at(t);
    ASSERT_EQ(objects.size(), 3U);
    ASSERT_EQ(simulated.truth.objects.size(), 3U);
    for (std::size_t i = 0; i < 3; ++i) {
      EXPECT_EQ(objects[i].is_there, is_there[i]) << t;
      EXPECT_EQ(simulated.truth.objects[i].p_exists, is_there[i] ? 1.0 : 0.0) << t;
      EXPECT_EQ(simulated.truth.objects[i].beams > 0, is_there[i]) << t;
    }
  }
}

TEST(Presence, ASweepSeesObjectsAppear) {
  const WorldFile file(kComingAndGoing);
  SimulatedScannerParams params;
  params.rate_hz = 4.0;
  params.sweep_s = 0.2;
  params.range_sigma_m = 0.0;
  ScanSimulation simulation(file.path(), params, 1);
  for (int scan = 0; scan < 8; ++scan) {
    const SimulatedScan simulated = simulation.next();
    // The beam ahead is in the middle of the sweep.
    const double t = 0.25 * scan + 0.1;
    EXPECT_NEAR(simulated.scan.beams[540].range_m, t >= 0.5 && t < 1.0 ? 2.7 : 6.0, 1e-4) << t;
  }
}

TEST(Presence, WorldsNameTheirErrors) {
  const std::string post = object_text("post", "pos=\"2 0 1\"", "0.2 0.1 1");
  const auto with_path = [&](const std::string& path) {
    return world_text(kRobot + post, "<text name=\"post\" data=\"" + path + "\"/>");
  };
  EXPECT_EQ(error_of(with_path("stand appears 2")), "no error");
  expect_error(with_path("stand spin 1 appears 2"), {"post", "mocap"});
  expect_error(with_path("line from 0 0 to 1 0 period 3 goes 2"), {"post", "mocap"});
  expect_error(with_path("stand appears 2 goes 2"), {"post", "goes", "appears"});
  expect_error(world_text(kRobot, "<text name=\"robot\" data=\"stand goes 3\"/>"), {"robot", "appears", "goes"});
  const std::string walker = "<body name=\"door\" mocap=\"true\"><geom size=\"0.1\"/></body>";
  expect_error(world_text(kRobot + walker, "<text name=\"door\" data=\"stand goes 3\"/>"), {"door", "group", "0"});
}

}  // namespace
}  // namespace situation_awareness::presence_test

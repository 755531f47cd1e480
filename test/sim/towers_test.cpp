// SPDX-License-Identifier: BSD-3-Clause
// Scripted rounds in the wind, and those of the world `towers`.
#include "situation_awareness/path/rounds.hpp"

#include <algorithm>
#include <cmath>
#include <limits>
#include <map>
#include <stdexcept>
#include <string>
#include <vector>

#include <gtest/gtest.h>

#include "situation_awareness/geometry/angles.hpp"
#include "situation_awareness/sim/fixed_wing.hpp"
#include "situation_awareness/sim/sensors.hpp"
#include "situation_awareness/sim/world.hpp"

namespace situation_awareness::towers_test {
namespace {

World towers() { return World(std::string(SITUATION_AWARENESS_SOURCE_DIR) + "/models/worlds/towers.xml"); }

double area_of(const std::vector<Eigen::Vector2d>& outline) {
  double twice_m2 = 0.0;
  for (std::size_t i = 0; i < outline.size(); ++i) {
    const Eigen::Vector2d& a = outline[i];
    const Eigen::Vector2d& b = outline[(i + 1) % outline.size()];
    twice_m2 += a.x() * b.y() - a.y() * b.x();
  }
  return 0.5 * twice_m2;
}

double distance_to(const std::vector<Eigen::Vector2d>& outline, const Eigen::Vector2d& p_m) {
  double least_m = std::numeric_limits<double>::infinity();
  for (std::size_t i = 0; i < outline.size(); ++i) {
    const Eigen::Vector2d way_m = outline[(i + 1) % outline.size()] - outline[i];
    const double part = std::clamp(way_m.dot(p_m - outline[i]) / way_m.squaredNorm(), 0.0, 1.0);
    least_m = std::min(least_m, (outline[i] + part * way_m - p_m).norm());
  }
  return least_m;
}

TEST(Rounds, FliesAroundEachCircleInTheWind) {
  FixedWingParams params;
  params.wind_north_m_s = 1.2;
  FixedWing aircraft(params, {{-40.0, 5.0}, 0.0}, 15.0);
  const std::vector<Eigen::Vector3d> circles{{0.0, 0.0, 14.0}, {40.0, 20.0, 10.0}};
  Rounds rounds(circles, {}, 1.0 / params.radius_m);
  std::vector<double> turned_rad(circles.size(), 0.0);
  double last_rad = 0.0;
  while (!rounds.done() && aircraft.time_s() < 120.0) {
    const Eigen::Vector2d v = aircraft.velocity_world_m_s();
    const Eigen::Vector2d p_m = aircraft.state().T_world_robot.translation_m;
    aircraft.command(rounds.turn_rate({p_m, std::atan2(v.y(), v.x())}, v.norm()));
    aircraft.advance(aircraft.time_s() + 0.05);
    const double course_rad = std::atan2(v.y(), v.x());
    for (std::size_t i = 0; i < circles.size(); ++i) {
      if (std::abs((p_m - circles[i].head<2>()).norm() - circles[i].z()) > 1.0) continue;
      turned_rad[i] += wrap_to_pi(course_rad - last_rad);
    }
    last_rad = course_rad;
  }
  EXPECT_TRUE(rounds.done());
  for (const double turned : turned_rad) EXPECT_GT(turned, 2.0 * kPi * 1.2);
}

TEST(Rounds, RefusesCirclesThatCannotBeFlown) {
  EXPECT_THROW(Rounds({}, {}, 1.0), std::invalid_argument);
  EXPECT_THROW(Rounds({{0.0, 0.0, 5.0}}, {}, 1.0 / 6.0), std::invalid_argument);
}

TEST(TowersWorld, HasItsBuildings) {
  World world = towers();
  ASSERT_NE(world.aircraft(), nullptr);
  EXPECT_EQ(world.vehicle(), nullptr);
  std::map<std::string, std::vector<Eigen::Vector2d>> outlines;
  for (const TrueOutline& outline : world.outlines_at(0.0, 15.0)) outlines[outline.thing] = outline.points_world_m;
  for (const char* name : {"ellipse", "kidney", "box", "pole_1", "pole_5"}) ASSERT_EQ(outlines.count(name), 1U) << name;
  EXPECT_NEAR(area_of(outlines["ellipse"]), kPi * 60.0, 1.0);
  EXPECT_NEAR(area_of(outlines["box"]), 84.0, 1e-3);
  EXPECT_GT(area_of(outlines["kidney"]), 150.0);
  EXPECT_LT(area_of(outlines["kidney"]), kPi * 9.5 * 7.0) << "it has a pocket";
  const WorldSensors sensors = sensors_of(world);
  ASSERT_EQ(sensors.imus.size(), 1U);
  EXPECT_EQ(sensors.imus[0].params.rate_hz, 200.0);
  ASSERT_EQ(sensors.gnss_receivers.size(), 1U);
  EXPECT_EQ(sensors.gnss_receivers[0].params.rate_hz, 5.0);
}

TEST(TowersWorld, ItsRoundsStayClear) {
  World world = towers();
  FixedWing& aircraft = *world.aircraft();
  Rounds rounds(world.rounds(), {}, 1.0 / aircraft.params().radius_m);
  const std::vector<TrueOutline> outlines = world.outlines_at(0.0, 15.0);
  double least_m = std::numeric_limits<double>::infinity();
  while (!rounds.done() && aircraft.time_s() < 180.0) {
    const Eigen::Vector2d v = aircraft.velocity_world_m_s();
    const Eigen::Vector2d p_m = aircraft.state().T_world_robot.translation_m;
    aircraft.command(rounds.turn_rate({p_m, std::atan2(v.y(), v.x())}, v.norm()));
    aircraft.advance(aircraft.time_s() + 0.05);
    for (const TrueOutline& outline : outlines) least_m = std::min(least_m, distance_to(outline.points_world_m, p_m));
  }
  EXPECT_TRUE(rounds.done());
  EXPECT_GT(least_m, 5.0);
  EXPECT_GT(aircraft.time_s(), 80.0);
}

}  // namespace
}  // namespace situation_awareness::towers_test

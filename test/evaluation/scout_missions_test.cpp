// SPDX-License-Identifier: BSD-3-Clause
#include "situation_awareness/evaluation/scout_missions.hpp"

#include <gtest/gtest.h>

#include <cstdint>

namespace situation_awareness::scout_missions_test {
namespace {

ScoutMission small_mission(std::uint64_t seed, bool hills) {
  ScoutMission mission = random_scout_mission(seed, hills);
  mission.label_px = 56;
  mission.params.seed = static_cast<int>(seed);
  return mission;
}

// docs/benchmarks/grid.md has 20 of them, with larger labels.
TEST(ScoutMissionFlightsLong, CarsAreFoundSoonerThanByALawnmower) {
  const ScoutMission mission = small_mission(1, false);
  const ScoutMissionOutcome scouting = fly_scouting(mission, 1), lawnmower = fly_lawnmower(mission, 40.0, 1);
  EXPECT_TRUE(scouting.home_in_time);
  EXPECT_EQ(scouting.found, scouting.cars);
  EXPECT_EQ(scouting.wrong, 0);
  EXPECT_LT(scouting.worst_centroid_m, 1.5);
  EXPECT_EQ(scouting.close_ups, scouting.cars);
  EXPECT_LT(scouting.last_found_s, 0.8 * lawnmower.last_found_s);
}

TEST(ScoutMissionFlightsLong, HillsAndAnElevationWithErrorsHideNoCar) {
  const ScoutMissionOutcome scouting = fly_scouting(small_mission(3, true), 3);
  EXPECT_TRUE(scouting.home_in_time);
  EXPECT_EQ(scouting.found, scouting.cars);
  EXPECT_EQ(scouting.wrong, 0);
  EXPECT_LT(scouting.worst_centroid_m, 1.5);
}

TEST(ScoutMissions, TheLawnmowerDoesNotKnowWhereTheCarsAre) {
  ScoutMission mission = small_mission(5, false);
  mission.label_px = 16;
  mission.params.image_rate_hz = 0.5;
  mission.scene.trees.clear();
  mission.scene.cars.resize(1);
  mission.scene.cars[0].T_world_car = {{0.0, -70.0}, 0.0};
  ScoutMission empty = mission;
  empty.scene.cars.clear();
  const ScoutMissionOutcome flown = fly_lawnmower(mission, 40.0, 5);
  EXPECT_EQ(flown.flown_m, fly_lawnmower(empty, 40.0, 5).flown_m);
  EXPECT_TRUE(flown.home_in_time);
}

TEST(ScoutMissions, TheSameSeedGivesTheSame) {
  ScoutMission mission = small_mission(4, false);
  mission.params.routes = 4;
  mission.params.changes = 40;
  mission.params.budget_s = 45.0;
  const ScoutMissionOutcome a = fly_scouting(mission, 4), b = fly_scouting(mission, 4);
  EXPECT_EQ(a.flown_m, b.flown_m);
  EXPECT_TRUE(a.home_in_time);
}

}  // namespace
}  // namespace situation_awareness::scout_missions_test

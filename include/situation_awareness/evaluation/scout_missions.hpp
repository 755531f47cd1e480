// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstdint>
#include <vector>

#include <Eigen/Core>

#include "situation_awareness/evaluation/grid_scenes.hpp"
#include "situation_awareness/path/obstacles.hpp"
#include "situation_awareness/path/scouting.hpp"

namespace situation_awareness {

// Missions of a simulated multirotor over cars and trees (docs/math/scouting.md): label images computed by casting
// rays, mapped by the grid pipeline, whose targets lead the mission on.

/// What a mission is flown over, and with.
struct ScoutMission {
  GridScene scene;
  double elevation_bias_m = 0.0;   ///< of the elevation that is given: common
  double elevation_noise_m = 0.0;  ///< of each of its pixels
  int label_px = 112;              ///< along the edge of a label image
  Obstacles obstacles;
  Eigen::Vector2d home_world_m{0.0, -95.0};
  ScoutingParams params;  ///< of a lawnmower the region, the budget, the camera, and how it flies
};

/// 12 cars and 40 trees at random places of the region, on gentle hills if wanted; the same seed gives the same one.
ScoutMission random_scout_mission(std::uint64_t seed, bool hills);

struct ScoutMissionOutcome {
  int cars = 0;
  int found = 0;  ///< cars with a target of their own within 3 m at the end
  int wrong = 0;  ///< targets that are none of these
  double worst_centroid_m = 0.0;
  double last_found_s = 0.0;  ///< when the last car had its target for the first time; the budget, if one never had
  double home_s = 0.0;        ///< when it was home; infinite, if it never was
  bool home_in_time = false;
  int close_ups = 0;  ///< that were done
  double way_m = 0.0;
  double least_clearance_m = 0.0;        ///< from obstacles; infinite without any
  double longest_step_s = 0.0;           ///< of computing a step of the mission
  std::vector<Eigen::Vector3d> flown_m;  ///< each second
};

/// Until it is done or the budget has ended.
ScoutMissionOutcome fly_scouting(const ScoutMission& mission, std::uint64_t seed);

/// To and fro along x over the region, `lane_m` apart, looking ahead, then along y, and home: a way that does not
/// depend on what is found.
ScoutMissionOutcome fly_lawnmower(const ScoutMission& mission, double lane_m, std::uint64_t seed);

}  // namespace situation_awareness

// SPDX-License-Identifier: BSD-3-Clause
// The worlds of models/worlds: clearances, visibility of all objects, and tracking of the robot's path.
#include <algorithm>
#include <array>
#include <cmath>
#include <filesystem>
#include <limits>
#include <map>
#include <ostream>
#include <string>
#include <vector>

#include <gtest/gtest.h>
#include <mujoco/mujoco.h>

#include "situation_awareness/geometry/angles.hpp"
#include "situation_awareness/sim/scan_simulation.hpp"

namespace situation_awareness::worlds_test {
namespace {

constexpr double kClearance_m = 0.4;
constexpr double kRobotRadius_m = 0.5;

struct Shown {
  const char* name;
  std::size_t walls;           ///< boxes that nothing may touch
  std::size_t least_standing;  ///< objects
  std::size_t least_moving;
  bool flown;  ///< by motors
};

void PrintTo(const Shown& shown, std::ostream* stream) { *stream << shown.name; }

std::string file_of(const Shown& shown) {
  return std::string(SITUATION_AWARENESS_SOURCE_DIR) + "/models/worlds/" + shown.name + ".xml";
}

/// A shape with a closed chain of points as outline, or a box with a distance function.
struct Outline {
  std::string name;
  Eigen::Vector2d center_m;
  double reach_m;
  std::vector<Eigen::Vector2d> points;
};

Outline outline_of(const std::string& name, const Ellipse& ellipse) {
  constexpr int kPoints = 64;
  Outline outline{name, ellipse.center_m, ellipse.rx_m, {}};
  const Eigen::Rotation2Dd R(ellipse.psi_rad);
  for (int i = 0; i < kPoints; ++i) {
    const double angle = 2.0 * kPi * i / kPoints;
    outline.points.push_back(ellipse.center_m +
                             R * Eigen::Vector2d(ellipse.rx_m * std::cos(angle), ellipse.ry_m * std::sin(angle)));
  }
  return outline;
}

/// Infinity where they are far apart.
double distance_between(const Outline& a, const Outline& b) {
  double distance_m = std::numeric_limits<double>::infinity();
  if ((a.center_m - b.center_m).norm() > a.reach_m + b.reach_m + kClearance_m) return distance_m;
  for (const Eigen::Vector2d& p : a.points) {
    for (const Eigen::Vector2d& q : b.points) distance_m = std::min(distance_m, (p - q).norm());
  }
  return distance_m;
}

struct Box {
  std::string name;
  Eigen::Vector2d center_m, half_m;
};

double distance_between(const Outline& a, const Box& box) {
  double distance_m = std::numeric_limits<double>::infinity();
  for (const Eigen::Vector2d& p : a.points) {
    distance_m = std::min(distance_m, ((p - box.center_m).cwiseAbs() - box.half_m).cwiseMax(0.0).norm());
  }
  return distance_m;
}

/// The walls of a world, straight from the file; axis-parallel as they are there.
std::vector<Box> walls_of(const std::string& path) {
  std::array<char, 1000> error{};
  mjModel* const model = mj_loadXML(path.c_str(), nullptr, error.data(), static_cast<int>(error.size()));
  EXPECT_NE(model, nullptr) << error.data();
  std::vector<Box> walls;
  for (int i = 0; model != nullptr && i < model->ngeom; ++i) {
    if (model->geom_type[i] != mjGEOM_BOX || model->geom_group[i] != 0) continue;
    EXPECT_EQ(model->geom_bodyid[i], 0);
    EXPECT_EQ(model->geom_quat[4 * i], 1.0);
    const mjtNum* const p = model->geom_pos + 3 * i;
    const mjtNum* const s = model->geom_size + 3 * i;
    walls.push_back({mj_id2name(model, mjOBJ_GEOM, i), {p[0], p[1]}, {s[0], s[1]}});
  }
  mj_deleteModel(model);
  return walls;
}

/// The body of which an object is a part.
std::string body_of(const std::string& name) { return name.substr(0, name.rfind('/')); }

class WorldOfTheLibrary : public testing::TestWithParam<Shown> {};

TEST_P(WorldOfTheLibrary, HasItsClearances) {
  const std::vector<Box> walls = walls_of(file_of(GetParam()));
  ASSERT_EQ(walls.size(), GetParam().walls);
  const std::vector<std::string> names = World(file_of(GetParam())).names();
  const World world(file_of(GetParam()));
  std::map<std::string, std::pair<double, double>> nearest;  // distance and when
  for (double t = 0.0; t < 180.0; t += 0.1) {
    std::vector<Outline> outlines;
    const std::vector<TrueObject> objects = world.objects_at(t);
    for (std::size_t i = 0; i < names.size(); ++i) {
      outlines.push_back(outline_of(names[i], *objects[i].ellipse_world));
    }
    const Eigen::Vector2d robot = world.robot_at(t).T_world_robot.translation().head<2>();
    outlines.push_back(outline_of("robot", {robot, 0.0, kRobotRadius_m, kRobotRadius_m}));
    const auto note = [&](const std::string& a, const std::string& b, double distance_m) {
      if (distance_m >= kClearance_m) return;
      const auto [place, is_new] = nearest.try_emplace(a + " and " + b, distance_m, t);
      if (!is_new && distance_m < place->second.first) place->second = {distance_m, t};
    };
    for (std::size_t a = 0; a < outlines.size(); ++a) {
      for (std::size_t b = 0; b < a; ++b) {
        if (body_of(outlines[a].name) == body_of(outlines[b].name)) continue;
        note(outlines[a].name, outlines[b].name, distance_between(outlines[a], outlines[b]));
      }
      for (const Box& wall : walls) note(outlines[a].name, wall.name, distance_between(outlines[a], wall));
    }
  }
  for (const auto& [pair, distance] : nearest) {
    ADD_FAILURE() << pair << " are " << distance.first << " m apart at " << distance.second << " s";
  }
}

TEST_P(WorldOfTheLibrary, ShowsStandingAndMovingObjects) {
  ScanSimulation world(file_of(GetParam()), {}, 0);
  const SimulatedScan first = world.next();
  std::vector<int> scans_seen(first.names.size(), 0);
  std::size_t standing = 0;
  const std::vector<TrueObject> later = world.world().objects_at(5.0);
  for (std::size_t i = 0; i < first.names.size(); ++i) {
    standing += later[i].ellipse_world->center_m == first.truth.objects[i].ellipse_world.center_m ? 1 : 0;
  }
  EXPECT_GE(standing, GetParam().least_standing);
  EXPECT_GE(first.names.size() - standing, GetParam().least_moving);
  double tilt_rad = 0.0;
  for (int scan = 1; scan < 1200; ++scan) {
    const SimulatedScan simulated = world.next();
    tilt_rad = std::max(tilt_rad, std::acos(simulated.robot.T_world_robot(2, 2)));
    for (std::size_t i = 0; i < scans_seen.size(); ++i) scans_seen[i] += simulated.truth.objects[i].beams >= 5 ? 1 : 0;
  }
  for (std::size_t i = 0; i < scans_seen.size(); ++i) EXPECT_GT(scans_seen[i], 60) << first.names[i];
  EXPECT_GT(tilt_rad, radians(1.0));
  EXPECT_LT(tilt_rad, radians(15.0));
}

INSTANTIATE_TEST_SUITE_P(Worlds, WorldOfTheLibrary,
                         testing::Values(Shown{"demo", 6, 5, 4, false}, Shown{"lab", 8, 5, 6, true},
                                         Shown{"orchard", 0, 29, 3, true}, Shown{"warehouse", 7, 10, 4, true},
                                         Shown{"crowd", 1, 9, 12, true}),
                         [](const auto& info) { return std::string(info.param.name); });

}  // namespace
}  // namespace situation_awareness::worlds_test

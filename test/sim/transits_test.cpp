// SPDX-License-Identifier: BSD-3-Clause
// A vehicle that drives from dock to dock, and a world that changes meanwhile.
#include "situation_awareness/sim/transits.hpp"

#include <algorithm>
#include <cmath>
#include <limits>
#include <stdexcept>
#include <string>
#include <vector>

#include <gtest/gtest.h>
#include <yaml-cpp/yaml.h>

#include "sim/world_file.hpp"
#include "situation_awareness/geometry/angles.hpp"
#include "situation_awareness/sim/scanner.hpp"
#include "situation_awareness/sim/sensors.hpp"
#include "situation_awareness/sim/wheel_odometry.hpp"

namespace situation_awareness::transits_test {
namespace {

const std::string kVehicle = R"(<body name="robot" mocap="true" pos="0 0 0.2"> <site name="lidar" pos="0.1 0 0.1"/>
                                <site name="wheels"/> <geom group="2" size="0.2"/> </body>)";

/// A way of 3 m along x between a wall at y = 1.2 and: a box that stands there in transits 2 and 3, a reflector that
/// goes with transit 1, and a walker in transit 2, from its second second on.
const std::string kWay =
    world_text(kVehicle + R"(<geom name="wall/north" type="box" pos="1.5 1.3 1" size="4 0.1 1"/>
                  <geom name="table" type="box" pos="1.5 -1.3 2" size="0.3 0.3 0.5"/>
                  <body name="reflector" pos="1.5 -1 0.5"><geom type="cylinder" size="0.05 0.5" user="0.5 0 6"/></body>
                  <body name="box" pos="2.5 -0.9 0.5"><geom type="box" group="1" size="0.2 0.1 0.5"/></body>)" +
                   object_text("walker", "mocap=\"true\" pos=\"3 2 1\"", "0.15 0.15 1"),
               R"(<text name="robot" data="unicycle max_speed_m_s 0.8"/> <numeric name="docks" data="0 0 3 0"/>
       <text name="box" data="stand transits 3 2"/> <text name="reflector" data="stand transits 1"/>
       <text name="walker" data="straight from 4 -0.8 velocity -0.5 0 transits 2 appears 2"/>
       <text name="wheels" data="odometry"/>)",
               "<size nuser_geom=\"3\"/>");

/// Drives to the dock ahead, straight on, as a path follower would.
void drive_to_dock(World& world, Transits& transits) {
  const double limit_s = world.vehicle()->time_s() + 60.0;
  while (!transits.docked() && world.vehicle()->time_s() < limit_s) {
    const UnicycleState& state = world.vehicle()->state();
    const Eigen::Vector2d& ahead_m = world.docks()[static_cast<std::size_t>(transits.transit()) % world.docks().size()];
    const double left_m = (inverse(state.T_world_robot) * ahead_m).x();
    transits.command(std::clamp(left_m, 0.0, 0.5), 0.0);
    transits.advance(world.vehicle()->time_s() + 0.02);
  }
}

void wait_for_departure(World& world, Transits& transits) {
  const double limit_s = world.vehicle()->time_s() + 60.0;
  while (transits.docked() && world.vehicle()->time_s() < limit_s) {
    transits.command(1.0, 1.0);  // ignored
    transits.advance(world.vehicle()->time_s() + 0.02);
  }
}

bool stands(const World& world, const std::string& thing) {
  for (const TrueOutline& outline : world.outlines_at(world.vehicle()->time_s(), 0.3)) {
    if (outline.thing == thing) return outline.is_there;
  }
  return false;
}

TEST(Transits, TheVehicleGoesToAndFroAndThingsChangeInTheDock) {
  const WorldFile file(kWay);
  World world(file.path());
  TransitsParams params;
  params.transits = 3;
  Transits transits(world, params);
  for (int transit = 1; transit <= 3; ++transit) {
    EXPECT_EQ(transits.transit(), transit);
    const double heading_rad = world.vehicle()->state().T_world_robot.yaw_rad;
    EXPECT_NEAR(wrap_to_pi(heading_rad - (transit % 2 == 0 ? kPi : 0.0)), 0.0, 0.02);
    EXPECT_EQ(stands(world, "box"), transit >= 2);
    EXPECT_EQ(stands(world, "reflector"), transit == 1);
    EXPECT_FALSE(stands(world, "walker"));
    EXPECT_TRUE(stands(world, "wall"));
    drive_to_dock(world, transits);
    EXPECT_EQ(stands(world, "walker"), transit == 2);
    EXPECT_TRUE(transits.docked());
    EXPECT_EQ(transits.done(), transit == 3);
    const double x_m = world.vehicle()->state().T_world_robot.translation_m.x();
    EXPECT_NEAR(x_m, transit % 2 == 0 ? 0.0 : 3.0, params.dock_radius_m);
    EXPECT_GE(transits.end_s() - transits.begin_s(), 3.0 / 0.5);
    if (transit < 3) {
      wait_for_departure(world, transits);
      EXPECT_NEAR(world.vehicle()->state().T_world_robot.translation_m.x(), x_m, 2e-3);  // turned on the spot
      EXPECT_GE(transits.begin_s(), params.docked_s);
    }
  }
}

TEST(Transits, TheScannerSeesWhatStandsInTheTransit) {
  const WorldFile file(kWay);
  World world(file.path());
  Transits transits(world, {});
  SimulatedScannerParams params;
  params.range_sigma_m = 0.0;
  SimulatedScanner scanner(world, world.T_robot_lidar(), params, 1);
  const auto hits_box = [&] {
    while (scanner.next_time_s() <= world.vehicle()->time_s() - 1.0 / params.rate_hz) scanner.skip();
    const ScannerSample sample = scanner.next();
    return std::count_if(sample.hits.begin(), sample.hits.end(), [](const TrueHit& hit) { return hit.object == 0; });
  };
  EXPECT_EQ(world.names()[0], "box");
  transits.advance(0.1);
  EXPECT_EQ(hits_box(), 0);
  drive_to_dock(world, transits);
  wait_for_departure(world, transits);
  transits.advance(world.vehicle()->time_s() + 0.1);
  EXPECT_GT(hits_box(), 10);
}

TEST(Transits, OdometryFollowsTheVehicle) {
  const WorldFile file(kWay);
  World world(file.path());
  Transits transits(world, {});
  const WorldSensors sensors = sensors_of(world);
  SimulatedOdometryParams params = sensors.odometries.at(0).params;
  params.distance_noise = params.yaw_noise_of_distance = params.yaw_noise_of_yaw = 0.0;
  params.distance_scale_sigma = params.yaw_scale_sigma = 0.0;
  SimulatedOdometry odometry(world, sensors.odometries.at(0).T_robot_sensor, params, 1);
  for (int i = 0; i < 500; ++i) {
    transits.command(0.4, 0.3 * std::sin(0.05 * i));
    transits.advance(0.02 * i);
    const OdometrySample sample = odometry.next();
    const Pose2& truth = world.vehicle()->state().T_world_robot;
    ASSERT_NEAR((sample.T_odom_base.translation_m - truth.translation_m).norm(), 0.0, 1e-9);
    ASSERT_NEAR(wrap_to_pi(sample.T_odom_base.yaw_rad - truth.yaw_rad), 0.0, 1e-9);
  }
}

TEST(Transits, OutlinesAreOfWhatReachesTheHeight) {
  const WorldFile file(kWay);
  const World world(file.path());
  const auto things = [&](double height_m) {
    std::vector<std::string> names;
    for (const TrueOutline& outline : world.outlines_at(0.0, height_m)) names.push_back(outline.thing);
    return names;
  };
  EXPECT_EQ(things(0.3), (std::vector<std::string>{"wall", "reflector", "box", "walker"}));
  EXPECT_EQ(things(2.2), (std::vector<std::string>{"table", "walker"}));
  const std::vector<TrueOutline> outlines = world.outlines_at(0.0, 0.3);
  EXPECT_TRUE(outlines[3].can_move && !outlines[2].can_move);
  const std::vector<Eigen::Vector2d> box = {{2.3, -1.0}, {2.7, -1.0}, {2.7, -0.8}, {2.3, -0.8}};
  ASSERT_EQ(outlines[2].points_world_m.size(), 4U);
  for (std::size_t i = 0; i < 4; ++i) EXPECT_LT((outlines[2].points_world_m[i] - box[i]).norm(), 1e-12);
  for (const Eigen::Vector2d& p : outlines[1].points_world_m) {
    EXPECT_NEAR((p - Eigen::Vector2d(1.5, -1.0)).norm(), 0.05, 1e-12);
  }
}

TEST(Transits, OneDockIsForRounds) {
  const WorldFile file(replaced(kWay, "0 0 3 0", "0 0"));
  World world(file.path());
  TransitsParams params;
  params.transits = 2;
  Transits transits(world, params);
  transits.advance(5.0);
  EXPECT_FALSE(transits.docked()) << "it has not left yet";
  while (world.vehicle()->time_s() < 5.0 + 2.0 * kPi / 0.5) {
    transits.command(0.5, 0.5);
    transits.advance(world.vehicle()->time_s() + 0.02);
  }
  for (int i = 0; i < 100 && !transits.docked(); ++i) {
    transits.command(0.0, 0.0);
    transits.advance(world.vehicle()->time_s() + 0.02);
  }
  ASSERT_TRUE(transits.docked());
  wait_for_departure(world, transits);
  EXPECT_EQ(transits.transit(), 2);
  EXPECT_NEAR(wrap_to_pi(world.vehicle()->state().T_world_robot.yaw_rad), 0.0, 0.02);
}

/// The least distance of a place from an outline.
double distance_to(const TrueOutline& outline, const Eigen::Vector2d& p_world_m) {
  double least_m = std::numeric_limits<double>::infinity();
  for (std::size_t i = 0; i < outline.points_world_m.size(); ++i) {
    const Eigen::Vector2d& a = outline.points_world_m[i];
    const Eigen::Vector2d edge = outline.points_world_m[(i + 1) % outline.points_world_m.size()] - a;
    const double along = std::clamp((p_world_m - a).dot(edge) / edge.squaredNorm(), 0.0, 1.0);
    least_m = std::min(least_m, (p_world_m - a - along * edge).norm());
  }
  return least_m;
}

TEST(Corridor, TheWayIsFreeInAllTransits) {
  constexpr double kVehicle_m = 0.26, kClearance_m = 0.5;
  World world(kWorlds + "corridor.xml");
  const YAML::Node path = YAML::LoadFile(kWorlds + "corridor.path.yaml")["path"];
  ASSERT_GE(path.size(), 2U);
  EXPECT_EQ(Eigen::Vector2d(path[0]["x"].as<double>(), path[0]["y"].as<double>()), world.docks().at(0));
  for (int transit = 1; transit <= 6; ++transit) {
    world.begin_transit(transit, 0.0);
    int standing = 0;
    for (const TrueOutline& outline : world.outlines_at(0.0, 0.3)) {
      if (!outline.is_there || outline.can_move) continue;
      ++standing;
      for (std::size_t i = 0; i + 1 < path.size(); ++i) {
        for (double part = 0.0; part <= 1.0; part += 0.02) {
          const auto at = [&](std::size_t k) {
            return Eigen::Vector2d(path[k]["x"].as<double>(), path[k]["y"].as<double>());
          };
          const Eigen::Vector2d p = (1.0 - part) * at(i) + part * at(i + 1);
          ASSERT_GT(distance_to(outline, p), kVehicle_m + kClearance_m) << outline.thing << ", transit " << transit;
        }
      }
    }
    EXPECT_GT(standing, 20);
  }
}

TEST(Corridor, OnlyReflectorsAreBrightAndTheyAreWhereTheFileSays) {
  World world(kWorlds + "corridor.xml");
  const YAML::Node reflectors = YAML::LoadFile(kWorlds + "corridor.reflectors.yaml")["reflectors"];
  ASSERT_EQ(reflectors.size(), 7U);
  std::vector<TrueOutline> outlines;
  for (const TrueOutline& outline : world.outlines_at(0.0, 0.3)) {
    if (outline.thing.rfind("reflector_", 0) == 0) outlines.push_back(outline);
  }
  ASSERT_EQ(outlines.size(), reflectors.size());
  for (std::size_t i = 0; i < outlines.size(); ++i) {
    const Eigen::Vector2d center(reflectors[i]["x"].as<double>(), reflectors[i]["y"].as<double>());
    for (const Eigen::Vector2d& p : outlines[i].points_world_m) {
      EXPECT_NEAR((p - center).norm(), reflectors[i]["radius_m"].as<double>(), 1e-9);
    }
  }
  // Of the beams that hit reflectors most are bright, of others at most those on the glossy pillar seen at right
  // angles.
  const WorldSensors sensors = sensors_of(world);
  SimulatedScanner scanner(world, world.T_robot_lidar(), sensors.scanners.at(0).params, 1);
  Transits transits(world, {});
  int scans = 0, on_reflector = 0, bright_on_reflector = 0, other = 0, bright_other = 0;
  while (!transits.docked() && world.vehicle()->time_s() < 100.0) {
    const double left_m = 13.6 - world.vehicle()->state().T_world_robot.translation_m.x();
    transits.command(std::clamp(left_m, 0.0, 0.5), 0.0);
    transits.advance(world.vehicle()->time_s() + 0.04);
    while (scanner.next_time_s() + 0.04 <= world.vehicle()->time_s()) {
      if (scans++ % 10 != 0) {
        scanner.skip();
        continue;
      }
      const ScannerSample sample = scanner.next();
      for (std::size_t i = 0; i < sample.scan.beams.size(); ++i) {
        const Beam& beam = sample.scan.beams[i];
        if (beam.state != BeamState::kHit) continue;
        const double time_s =
            1e-9 * static_cast<double>(sample.scan.stamp_ns) + static_cast<double>(i) * sample.scan.time_increment_s;
        const double angle_rad = sample.scan.angle_min_rad + static_cast<double>(i) * sample.scan.angle_increment_rad;
        const Eigen::Isometry3d T = world.robot_at(time_s).T_world_robot * world.T_robot_lidar();
        const Eigen::Vector3d p =
            T * Eigen::Vector3d(beam.range_m * std::cos(angle_rad), beam.range_m * std::sin(angle_rad), 0.0);
        const bool is_reflector = std::any_of(outlines.begin(), outlines.end(), [&](const TrueOutline& outline) {
          return distance_to(outline, p.head<2>()) < 0.03;
        });
        (is_reflector ? on_reflector : other) += 1;
        if (beam.intensity > 450.0F) (is_reflector ? bright_on_reflector : bright_other) += 1;
      }
    }
  }
  EXPECT_TRUE(transits.docked());
  EXPECT_GT(on_reflector, 500);
  EXPECT_GT(bright_on_reflector, 0.8 * on_reflector);
  EXPECT_LT(bright_other, 0.01 * other);
}

TEST(Transits, WorldsNameTheirErrors) {
  const auto with_robot = [](const std::string& text) {
    return world_text(kVehicle, "<text name=\"robot\" data=\"" + text + "\"/>");
  };
  EXPECT_EQ(error_of(with_robot("unicycle lag_s 0.2")), "no error");
  expect_error(with_robot("unicycle lag_s 0"), {"robot", "unicycle.lag_s", "0.002"});
  expect_error(with_robot("unicycle lag 0.1"), {"robot", "lag"});
  expect_error(with_robot("unicycle transits 2"), {"robot", "transits"});
  expect_error(world_text(kVehicle, "<numeric name=\"docks\" data=\"1 2 3\"/>"), {"docks"});
  const auto with_box = [](const std::string& path) { return replaced(kWay, "stand transits 3 2", path); };
  expect_error(with_box("stand transits 0"), {"box", "transits"});
  expect_error(with_box("stand transits 1.5"), {"box", "transits"});
  expect_error(with_box("stand transits"), {"box", "transits"});
  const WorldFile flown(kBriskWorld);
  World world(flown.path());
  EXPECT_NE(refusal_of<std::runtime_error>([&] { Transits(world, {}); }), "");
}

}  // namespace
}  // namespace situation_awareness::transits_test

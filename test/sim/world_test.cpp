// SPDX-License-Identifier: BSD-3-Clause
#include "situation_awareness/sim/world.hpp"

#include <algorithm>
#include <cmath>
#include <limits>
#include <optional>
#include <string>
#include <vector>

#include <gtest/gtest.h>

#include "sim/world_file.hpp"
#include "situation_awareness/geometry/angles.hpp"
#include "situation_awareness/sim/scan_simulation.hpp"
#include "situation_awareness/sim/truth.hpp"

namespace situation_awareness::world_test {
namespace {

// --- motion ---------------------------------------------------------------------------------------------------------

void expect_consistent_robot(const World& world) {
  constexpr double h = 1e-4;
  for (double t = 0.013; t < 40.0; t += 0.37) {
    const RobotState now = world.robot_at(t), before = world.robot_at(t - h), after = world.robot_at(t + h);
    const Eigen::Vector3d velocity =
        (after.T_world_robot.translation() - before.T_world_robot.translation()) / (2.0 * h);
    EXPECT_LT((velocity - now.velocity_world_m_s).norm(), 1e-6) << "t = " << t;
    const Eigen::AngleAxisd turn(before.T_world_robot.linear().transpose() * after.T_world_robot.linear());
    const Eigen::Vector3d angular_velocity = turn.angle() * turn.axis() / (2.0 * h);
    EXPECT_LT((angular_velocity - now.angular_velocity_robot_rad_s).norm(), 1e-6) << "t = " << t;
    EXPECT_TRUE(now.T_world_robot.linear().isUnitary(1e-12));
    EXPECT_NEAR(now.T_world_robot.linear().determinant(), 1.0, 1e-12);
  }
}

TEST(Robot, VelocitiesAreDerivativesOfThePose) {
  expect_consistent_robot(World(kWorlds + "demo.xml"));
  const WorldFile file(kBriskWorld);
  expect_consistent_robot(World(file.path()));
}

TEST(Robot, TiltsByItsAccelerationAndDrag) {
  const WorldFile file(kBriskWorld);
  const World world(file.path());
  constexpr double h = 1e-4;
  double largest_tilt = 0.0;
  for (double t = 0.0; t < 10.0; t += 0.21) {
    const RobotState now = world.robot_at(t);
    const Eigen::Vector3d acceleration =
        (world.robot_at(t + h).velocity_world_m_s - world.robot_at(t - h).velocity_world_m_s) / (2.0 * h);
    const Eigen::Vector3d thrust = acceleration + Eigen::Vector3d(0, 0, 9.81) + 0.3 * now.velocity_world_m_s;
    const Eigen::Vector3d z = now.T_world_robot.linear().col(2);
    EXPECT_LT((z - thrust.normalized()).norm(), 1e-6) << "t = " << t;
    largest_tilt = std::max(largest_tilt, tilt(now.T_world_robot));
  }
  EXPECT_GT(largest_tilt, radians(10.0));
  EXPECT_LT(largest_tilt, radians(25.0));
}

TEST(Robot, PassesItsWaypointsAtItsYaw) {
  const WorldFile file(world_text(
      R"(<body name="robot" mocap="true"> <site name="lidar"/> </body>)",
      R"(<text name="robot" data="loop speed 1 points 0 0 1 0; 2 0 1 1.5708; 2 2 1 3.1416; 0 2 1 -1.5708"/>)"));
  const World world(file.path());
  // By symmetry the four legs take equal times; per lap the robot turns once.
  double period_s = 1.0;
  while ((world.robot_at(period_s).T_world_robot.translation() - Eigen::Vector3d(0, 0, 1)).norm() > 1e-3) {
    ASSERT_LT(period_s += 1e-3, 20.0);
  }
  const std::vector<Eigen::Vector3d> waypoints = {{0, 0, 1}, {2, 0, 1}, {2, 2, 1}, {0, 2, 1}};
  for (int i = 0; i < 8; ++i) {
    const Eigen::Isometry3d T = world.robot_at(0.25 * i * period_s).T_world_robot;
    EXPECT_LT((T.translation() - waypoints[static_cast<std::size_t>(i % 4)]).norm(), 0.01);
    EXPECT_NEAR(wrap_to_pi(std::atan2(T(1, 0), T(0, 0)) - 0.5 * kPi * i), 0.0, 0.01);
  }
  double length_m = 0.0;
  for (int i = 0; i < 1000; ++i) length_m += world.robot_at(1e-3 * i * period_s).velocity_world_m_s.norm() * 1e-3;
  EXPECT_NEAR(length_m, 1.0, 1e-3);  // mean speed
}

TEST(Truth, VelocitiesAreDerivativesOfThePose) {
  for (const std::string& path : {kWorlds + "demo.xml", kWorlds + "single.xml"}) {
    const World world(path);
    constexpr double h = 1e-4;
    for (double t = 0.017; t < 60.0; t += 0.61) {
      const std::vector<TrueObject> now = world.objects_at(t), before = world.objects_at(t - h),
                                    after = world.objects_at(t + h);
      for (std::size_t i = 0; i < now.size(); ++i) {
        const TrueObject& object = now[i];
        const Ellipse& a = *before[i].ellipse_world;
        const Ellipse& b = *after[i].ellipse_world;
        EXPECT_LT(((b.center_m - a.center_m) / (2.0 * h) - object.velocity_world_m_s).norm(), 1e-6);
        EXPECT_NEAR(wrap_to_half_pi(b.psi_rad - a.psi_rad) / (2.0 * h), object.angular_velocity_rad_s, 1e-6);
      }
    }
  }
}

TEST(Truth, ListsObjectsInFileOrderWithCanonicalRadiiAndNoCovariance) {
  const WorldFile file(world_text(object_text("b", "pos=\"2 0 1\"", "0.2 0.5 1") + kRobot +
                                  object_text("a", "pos=\"-2 1 1\" euler=\"0 0 0.3\"", "0.4 0.1 1")));
  ScanSimulation world(file.path(), {}, 0);
  const SimulatedScan simulated = world.next();
  ASSERT_EQ(simulated.names, (std::vector<std::string>{"b", "a"}));
  ASSERT_EQ(simulated.truth.objects.size(), 2U);
  const Object& b = simulated.truth.objects[0];
  EXPECT_EQ(b.id, 1U);
  EXPECT_EQ(simulated.truth.objects[1].id, 2U);
  EXPECT_DOUBLE_EQ(b.ellipse_world.rx_m, 0.5);
  EXPECT_DOUBLE_EQ(b.ellipse_world.ry_m, 0.2);
  EXPECT_NEAR(std::abs(b.ellipse_world.psi_rad), 0.5 * kPi, 1e-12);
  EXPECT_NEAR(simulated.truth.objects[1].ellipse_world.psi_rad, 0.3, 1e-12);
  EXPECT_TRUE(b.covariance.isZero(0.0));
  EXPECT_DOUBLE_EQ(simulated.truth.height_world_m, 1.5);
}

TEST(Truth, AHiddenObjectHasNoBeamsAndKeepsItsTimeLastSeen) {
  // A screen passes between the robot and the pole.
  const WorldFile file(world_text(kRobot + object_text("pole", "pos=\"4 0 1\"", "0.1 0.1 1") +
                                      object_text("screen", "mocap=\"true\" pos=\"2 0 1\"", "0.1 0.4 1"),
                                  R"(<text name="screen" data="line from 2 -3 to 2 3 period 12"/>)"));
  ScanSimulation world(file.path(), {}, 0);
  int hidden_scans = 0, seen_scans = 0;
  std::int64_t first_seen_ns = -1, last_seen_ns = -1;
  for (int scan = 0; scan < 120; ++scan) {
    const SimulatedScan simulated = world.next();
    const Object& pole = simulated.truth.objects[0];
    const bool all_hidden = std::abs(simulated.truth.objects[1].ellipse_world.center_m.y()) < 0.3;
    if (all_hidden) {
      EXPECT_EQ(pole.beams, 0);
      ++hidden_scans;
    }
    if (pole.beams > 0) {
      ++seen_scans;
      last_seen_ns = simulated.scan.stamp_ns;
      if (first_seen_ns < 0) first_seen_ns = last_seen_ns;
    }
    EXPECT_EQ(pole.observations, seen_scans);
    EXPECT_EQ(pole.first_seen_ns, first_seen_ns);
    EXPECT_EQ(pole.last_seen_ns, last_seen_ns);
  }
  EXPECT_GT(hidden_scans, 5);
  EXPECT_GT(seen_scans, 50);
  EXPECT_EQ(world.truth_at(3.0).objects[0].observations, seen_scans);
}

TEST(Truth, CountsTheRowWithMostHitsWithinRange) {
  Sightings sightings(3, 10.0);
  // Two rows of four columns: object 0 in both rows of a column, object 1 once, object 2 too far away.
  const std::vector<TrueHit> hits = {{0, 2.0}, {1, 9.0}, {}, {2, 10.5}, {0, 2.0}, {0, 10.0}, {}, {2, 11.0}};
  EXPECT_EQ(sightings.add(5, hits, 4), (std::vector<int>{0, 1, -1, -1, 0, 0, -1, -1}));
  EXPECT_EQ(sightings.of_object()[0].beams, 2);
  EXPECT_EQ(sightings.of_object()[1].beams, 1);
  EXPECT_EQ(sightings.of_object()[2].beams, 0);
  sightings.add(7, {{0, 2.0}}, 1);
  EXPECT_EQ(sightings.of_object()[0].beams, 1);
  EXPECT_EQ(sightings.of_object()[0].observations, 2);
  EXPECT_EQ(sightings.of_object()[0].last_seen_ns, 7);
  EXPECT_EQ(sightings.of_object()[1].beams, 0);
  EXPECT_EQ(sightings.of_object()[1].observations, 1);
  EXPECT_EQ(sightings.of_object()[1].last_seen_ns, 5);
  EXPECT_EQ(sightings.of_object()[2].observations, 0);
  // Two rows of a tilted scanner meet object 0 in different columns.
  sightings.add(9, {{0, 2.0}, {}, {}, {}, {}, {}, {0, 2.0}, {0, 2.0}}, 4);
  EXPECT_EQ(sightings.of_object()[0].beams, 2);
}

// --- files ----------------------------------------------------------------------------------------------------------

TEST(World, RefusesBadFilesNamingFileAndElement) {
  const std::string post = object_text("post", "pos=\"2 0 1\"", "0.2 0.1 1");
  EXPECT_EQ(error_of(world_text(kRobot + post)), "no error");

  EXPECT_TRUE(
      names(refusal_of<std::runtime_error>([] { World("/nowhere/missing.xml"); }), {"/nowhere/missing.xml", "MuJoCo"}));
  expect_error("<mujoco><worldbody>", {"MuJoCo", "XML"});
  expect_error(world_text(kRobot + "<body name=\"b\"><geom type=\"ellipse\"/></body>"), {"MuJoCo", "XML"});
  expect_error(world_text(kRobot + "<body name=\"b\"><geom type=\"ellipsoid\" size=\"0.1 0 1\"/></body>"), {"MuJoCo"});
  expect_error(world_text(post), {"body", "robot"});
  expect_error(world_text("<body name=\"robot\"><site name=\"lidar\"/></body>"), {"robot", "mocap"});
  expect_error(world_text("<body name=\"robot\" mocap=\"true\"/>"), {"lidar", "robot"});
  expect_error(world_text("<body name=\"robot\" mocap=\"true\"/><site name=\"lidar\"/>"), {"lidar", "robot"});
  expect_error(
      world_text("<body name=\"robot\" mocap=\"true\"><geom name=\"arm\" size=\"1\"/><site name=\"lidar\"/></body>"),
      {"arm", "robot", "group", "2"});
  expect_error(world_text(kRobot + "<body name=\"ball\"><geom type=\"sphere\" group=\"1\" size=\"1\"/></body>"),
               {"ball", "ellipsoid", "box", "mesh"});
  expect_error(world_text(kRobot + "<body><geom type=\"ellipsoid\" group=\"1\" size=\"1 1 1\"/></body>"),
               {"object", "2"});
  expect_error(world_text(kRobot + "<geom name=\"loose\" type=\"ellipsoid\" group=\"1\" size=\"1 1 1\"/>"), {"loose"});
  expect_error(world_text(kRobot + object_text("lying", "euler=\"1 0 0\"", "1 1 1")), {"lying", "upright"});
  expect_error(
      world_text(kRobot +
                 "<body name=\"off\"><geom type=\"ellipsoid\" group=\"1\" size=\"1 1 1\" pos=\"1 0 0\"/></body>"),
      {"off", "pose"});
  expect_error(world_text(kRobot + "<body name=\"two\"><geom type=\"ellipsoid\" group=\"1\" size=\"1 1 1\"/>"
                                   "<geom type=\"ellipsoid\" group=\"1\" size=\"2 1 1\"/></body>"),
               {"two", "group", "1"});
  expect_error(world_text(kRobot + "<body name=\"b\"><joint name=\"hinge\"/><geom size=\"1\"/></body>"), {"hinge"});
  expect_error(world_text(kRobot + post, "<text name=\"pots\" data=\"stand\"/>"), {"pots"});
  expect_error(world_text(kRobot + post, "<text name=\"post\" data=\"stand\"/>"), {"post", "mocap"});
  const std::string turns = "<text name=\"hat\" data=\"stand spin 1\"/>";
  EXPECT_EQ(
      error_of(world_text(kRobot + "<body name=\"hat\" mocap=\"true\"><geom group=\"2\" size=\"0.1\"/></body>", turns)),
      "no error");
  expect_error(world_text(kRobot + "<body name=\"hat\" mocap=\"true\"><geom size=\"0.1\"/></body>", turns),
               {"hat", "group", "0"});
  expect_error(world_text(kRobot, "<text name=\"robot\" data=\"circle center 1\"/>"), {"robot", "2", "center"});
  const std::string pair = object_text("a", "mocap=\"true\"", "1 1 1") + object_text("b", "mocap=\"true\"", "1 1 1");
  EXPECT_EQ(error_of(world_text(kRobot + pair,
                                "<text name=\"a\" data=\"with b at 0 1\"/>"
                                "<text name=\"b\" data=\"stand\"/>")),
            "no error");
  expect_error(world_text(kRobot + pair, "<text name=\"a\" data=\"with b at 0 1\"/>"), {"a", "b"});
  expect_error(world_text(kRobot + pair,
                          "<text name=\"a\" data=\"with b at 0 1\"/>"
                          "<text name=\"b\" data=\"with a at 0 1\"/>"),
               {"b", "a"});
  expect_error(world_text(kRobot + pair,
                          "<text name=\"robot\" data=\"with b at 0 1\"/>"
                          "<text name=\"b\" data=\"stand\"/>"),
               {"robot", "b"});
  expect_error(world_text(kRobot, "<numeric name=\"robot_drag\" data=\"-1\"/>"), {"robot_drag", "0", "10"});
  expect_error(world_text(kRobot, "<numeric name=\"world_origin\" data=\"47 8\"/>"), {"world_origin", "3"});
  expect_error(world_text(kRobot, "<numeric name=\"world_origin\" data=\"91 8 400\"/>"),
               {"world_origin", "latitude", "91", "-90", "90"});
}

// --- the demo world -------------------------------------------------------------------------------------------------

TEST(World, SaysWhereItIsIfTheFileDoes) {
  const WorldFile nowhere(world_text(kRobot));
  EXPECT_FALSE(World(nowhere.path()).origin());
  const WorldFile somewhere(world_text(kRobot, "<numeric name=\"world_origin\" data=\"-33.9 151.2 40.5\"/>"));
  const World world(somewhere.path());
  ASSERT_TRUE(world.origin());
  EXPECT_EQ(world.origin()->latitude_deg, -33.9);
  EXPECT_EQ(world.origin()->longitude_deg, 151.2);
  EXPECT_EQ(world.origin()->altitude_m, 40.5);
}

TEST(World, HasTheFixturesOfItsFile) {
  const std::string walls = "<geom type=\"box\" pos=\"4 0 1\" size=\"0.1 4 1\"/>";
  const WorldFile file(world_text(
      walls + "<geom name=\"fixture/closet\" type=\"box\" pos=\"1 2 1\" size=\"0.6 0.3 1\" euler=\"0 0 0.4\"/>" +
      kRobot));
  const World world(file.path());
  ASSERT_EQ(world.fixtures().size(), 1U);
  const Box& closet = world.fixtures()[0];
  EXPECT_EQ(closet.center_m, Eigen::Vector2d(1.0, 2.0));
  EXPECT_NEAR(closet.psi_rad, 0.4, 1e-12);
  EXPECT_EQ(closet.half_length_m, 0.6);
  EXPECT_EQ(closet.half_width_m, 0.3);
  for (const std::string geom : {"type=\"sphere\" size=\"1\"", "type=\"box\" size=\"1 1 1\" euler=\"0.2 0 0\""}) {
    expect_error(world_text("<geom name=\"fixture/odd\" " + geom + "/>" + kRobot), {"fixture/odd", "upright"});
  }
}

TEST(DemoWorld, ShowsStandingAndMovingObjectsAndHidesThePoleForAWhile) {
  ScanSimulation world(kWorlds + "demo.xml", {}, 0);
  const std::vector<TrueObject> at_start = world.world().objects_at(0.0), later = world.world().objects_at(5.0);
  int standing = 0;
  for (std::size_t i = 0; i < later.size(); ++i) {
    standing += later[i].ellipse_world->center_m == at_start[i].ellipse_world->center_m ? 1 : 0;
  }
  EXPECT_GE(standing, 5);
  EXPECT_GE(static_cast<int>(later.size()) - standing, 4);

  std::vector<int> scans_seen(later.size(), 0);
  double hidden_s = 0.0, longest_hidden_s = 0.0, tilt_rad = 0.0;
  int visible = 0;
  constexpr int kScans = 1200;
  for (int scan = 0; scan < kScans; ++scan) {
    const SimulatedScan simulated = world.next();
    tilt_rad = std::max(tilt_rad, tilt(simulated.robot.T_world_robot));
    for (std::size_t i = 0; i < scans_seen.size(); ++i) {
      const Object& object = simulated.truth.objects[i];
      const double distance_m =
          (object.ellipse_world.center_m - simulated.T_world_lidar.translation().head<2>()).norm();
      if (object.beams >= 5 && distance_m < 10.0) ++scans_seen[i], ++visible;
      if (simulated.names[i] != "pole") continue;
      const Eigen::Vector3d p_lidar =
          simulated.T_world_lidar.inverse() *
          Eigen::Vector3d(object.ellipse_world.center_m.x(), object.ellipse_world.center_m.y(), 1.8);
      const bool in_view = std::abs(std::atan2(p_lidar.y(), p_lidar.x())) < radians(130.0);
      hidden_s = in_view && object.beams == 0 ? hidden_s + 0.05 : 0.0;
      longest_hidden_s = std::max(longest_hidden_s, hidden_s);
    }
  }
  for (std::size_t i = 0; i < scans_seen.size(); ++i) EXPECT_GT(scans_seen[i], kScans / 3) << "object " << i + 1;
  EXPECT_GT(visible, 6 * kScans);
  EXPECT_GT(longest_hidden_s, 2.0);
  EXPECT_LT(longest_hidden_s, 6.0);
  EXPECT_GT(tilt_rad, radians(3.0));
}

}  // namespace
}  // namespace situation_awareness::world_test

// SPDX-License-Identifier: BSD-3-Clause
// Objects that are boxes and polygons: their scans and their truth.
#include <algorithm>
#include <cmath>
#include <limits>
#include <sstream>
#include <string>
#include <vector>

#include <gtest/gtest.h>

#include "sim/world_file.hpp"
#include "situation_awareness/geometry/angles.hpp"
#include "situation_awareness/sim/ring_scanner.hpp"
#include "situation_awareness/sim/scan_simulation.hpp"

namespace situation_awareness::shapes_test {
namespace {

using Polygon = std::vector<Eigen::Vector2d>;

/// The asset of an upright prism; the polygon is counter-clockwise and seen as a whole from its first corner.
std::string prism(const std::string& name, const Polygon& polygon, double bottom_m, double top_m) {
  std::ostringstream vertices, faces;
  for (const double z : {bottom_m, top_m}) {
    for (const Eigen::Vector2d& p : polygon) vertices << p.x() << ' ' << p.y() << ' ' << z << "  ";
  }
  const std::size_t n = polygon.size();
  for (std::size_t i = 1; i + 1 < n; ++i) {
    faces << 0 << ' ' << i + 1 << ' ' << i << "  " << n << ' ' << n + i << ' ' << n + i + 1 << "  ";
  }
  for (std::size_t i = 0; i < n; ++i) {
    const std::size_t j = (i + 1) % n;
    faces << i << ' ' << j << ' ' << n + j << "  " << i << ' ' << n + j << ' ' << n + i << "  ";
  }
  return "<asset><mesh name=\"" + name + "\" vertex=\"" + vertices.str() + "\" face=\"" + faces.str() + "\"/></asset>";
}

/// An L, from its inner corner on.
const Polygon kL = {{0.25, 0.25}, {-0.25, 0.25}, {-0.25, 1.25}, {-0.75, 1.25}, {-0.75, -0.25}, {0.25, -0.25}};

std::string mesh_object(const std::string& name, const std::string& pose) {
  return "<body name=\"" + name + "\" " + pose + "><geom type=\"mesh\" group=\"1\" mesh=\"" + name + "\"/></body>";
}

std::string box_object(const std::string& name, const std::string& pose, const std::string& size) {
  return "<body name=\"" + name + "\" " + pose + "><geom type=\"box\" group=\"1\" size=\"" + size + "\"/></body>";
}

Polygon placed(const Polygon& polygon, const Pose2& T_world_object) {
  Polygon result;
  for (const Eigen::Vector2d& p : polygon) result.push_back(T_world_object * p);
  return result;
}

double area(const Polygon& polygon) {
  double sum = 0.0;
  for (std::size_t i = 0; i < polygon.size(); ++i) {
    const Eigen::Vector2d &a = polygon[i], &b = polygon[(i + 1) % polygon.size()];
    sum += 0.5 * (a.x() * b.y() - a.y() * b.x());
  }
  return sum;
}

/// Both list the same corners in the same order, wherever they begin.
void expect_same_outline(const Polygon& a, const Polygon& b, double tolerance_m = 1e-6) {
  ASSERT_EQ(a.size(), b.size());
  double best = std::numeric_limits<double>::infinity();
  for (std::size_t shift = 0; shift < a.size(); ++shift) {
    double worst = 0.0;
    for (std::size_t i = 0; i < a.size(); ++i) worst = std::max(worst, (a[i] - b[(i + shift) % b.size()]).norm());
    best = std::min(best, worst);
  }
  EXPECT_LT(best, tolerance_m);
}

/// Distance along the ray to the polygon's outline; infinity where it misses.
double range_to(const Polygon& polygon, const Eigen::Vector2d& origin, const Eigen::Vector2d& ray) {
  double range = std::numeric_limits<double>::infinity();
  for (std::size_t i = 0; i < polygon.size(); ++i) {
    const Eigen::Vector2d side = polygon[(i + 1) % polygon.size()] - polygon[i];
    Eigen::Matrix2d A;  // origin + s ray = corner + t side
    A << ray, -side;
    if (std::abs(A.determinant()) < 1e-12) continue;
    const Eigen::Vector2d st = A.inverse() * (polygon[i] - origin);
    if (st[0] > 0.0 && st[1] >= 0.0 && st[1] <= 1.0) range = std::min(range, st[0]);
  }
  return range;
}

TEST(Shapes, ScansOfABoxAndAMeshAreThoseOfTheirFootprints) {
  const WorldFile file(world_text(kRobot + box_object("crate", "pos=\"2.5 -1 1\" euler=\"0 0 0.4\"", "0.4 0.25 1") +
                                      mesh_object("hook", "mocap=\"true\" pos=\"0 0 0\" euler=\"0 0 0.3\"") +
                                      object_text("post", "pos=\"-1 -2 1\"", "0.3 0.3 1"),
                                  R"(<text name="hook" data="circle center 1.5 2 radius 0.6 rate 0.7 spin 0.9"/>)",
                                  prism("hook", kL, 0.0, 2.0)));
  SimulatedScannerParams params;
  params.range_sigma_m = 0.0;
  ScanSimulation simulation(file.path(), params, 1);
  const Polygon crate = placed({{-0.4, -0.25}, {0.4, -0.25}, {0.4, 0.25}, {-0.4, 0.25}}, {{2.5, -1.0}, 0.4});
  std::vector<int> hits(3, 0);
  for (int scan = 0; scan < 60; ++scan) {
    const double t = 0.05 * scan;
    const SimulatedScan simulated = simulation.next();
    ASSERT_EQ(simulation.world().names(), (std::vector<std::string>{"crate", "hook", "post"}));
    ASSERT_EQ(simulated.names, (std::vector<std::string>{"post"}));
    const Pose2 T_world_hook{{1.5 + 0.6 * std::cos(0.7 * t), 2.0 + 0.6 * std::sin(0.7 * t)}, 0.3 + 0.9 * t};
    const Polygon hook = placed(kL, T_world_hook);

    const std::vector<TrueObject> objects = simulation.world().objects_at(t);
    ASSERT_EQ(objects.size(), 3U);
    EXPECT_FALSE(objects[0].ellipse_world || objects[1].ellipse_world);
    expect_same_outline(objects[0].footprint_world_m, crate);
    expect_same_outline(objects[1].footprint_world_m, hook);
    EXPECT_GT(area(objects[0].footprint_world_m), 0.0);
    EXPECT_NEAR(area(objects[1].footprint_world_m), 0.5 * 1.5 + 0.5 * 0.5, 1e-6);
    EXPECT_LT((objects[1].T_world_object.translation_m - T_world_hook.translation_m).norm(), 1e-9);
    EXPECT_NEAR(objects[1].velocity_world_m_s.norm(), 0.42, 1e-9);
    EXPECT_NEAR(objects[1].angular_velocity_rad_s, 0.9, 1e-9);
    ASSERT_TRUE(objects[2].ellipse_world);
    EXPECT_TRUE(objects[2].footprint_world_m.empty());
    // A map of ellipses has only the post, with its id of the file.
    ASSERT_EQ(simulated.truth.objects.size(), 1U);
    EXPECT_EQ(simulated.truth.objects[0].id, 3U);
    EXPECT_GT(simulated.truth.objects[0].beams, 10);

    for (std::size_t i = 0; i < simulated.scan.beams.size(); ++i) {
      const double angle = simulated.scan.angle_min_rad + static_cast<double>(i) * simulated.scan.angle_increment_rad;
      const Eigen::Vector2d ray(std::cos(angle), std::sin(angle));
      const double to_crate = range_to(crate, {0, 0}, ray), to_hook = range_to(hook, {0, 0}, ray);
      const Beam& beam = simulated.scan.beams[i];
      if (simulated.object_of_beam[i] == 0) {  // the post, the only one in the truth
        ++hits[2];
        continue;
      }
      const double range_m = std::min(to_crate, to_hook);
      ASSERT_EQ(beam.state == BeamState::kHit, range_m < 30.0) << scan << ' ' << i;
      if (beam.state != BeamState::kHit) continue;
      ASSERT_NEAR(beam.range_m, range_m, 1e-5) << scan << ' ' << i;
      ++hits[to_crate < to_hook ? 0 : 1];
    }
  }
  for (const int count : hits) EXPECT_GT(count, 60 * 20);
}

TEST(Shapes, HitsArePlacesOnTheObjectThatTurnsAndMovesDuringAScan) {
  // Seen from the body the outline stands still, however late a beam is.
  const WorldFile file(
      world_text(kRobot + R"(<body name="crate" mocap="true" pos="0 0 1" euler="0 0 0.4">
                                                <geom type="box" group="1" size="0.4 0.25 1"/> </body>)" +
                     object_text("post", "mocap=\"true\" pos=\"0 0 1\" euler=\"0 0 0.2\"", "0.3 0.2 1"),
                 R"(<text name="crate" data="straight from 2 -1 velocity 0 1.5 spin 1.2"/>
                                     <text name="post" data="circle center -1 2 radius 0.5 rate 3"/>
                                     <text name="robot" data="circle center 0 0 radius 0.5 rate 2 spin -1"/>)"));
  SimulatedScannerParams params;
  params.range_sigma_m = 0.05;  // is not in the truth
  params.sweep_s = 0.045;
  ScanSimulation simulation(file.path(), params, 1);
  int on_crate = 0, on_post = 0;
  for (int scan = 0; scan < 40; ++scan) {
    const SimulatedScan simulated = simulation.next();
    ASSERT_EQ(simulated.hits.size(), simulated.scan.beams.size());
    for (const TrueHit& hit : simulated.hits) {
      if (hit.object < 0) continue;
      const Eigen::Vector2d& p_m = hit.p_object_m;
      if (hit.object == 0) {
        ++on_crate;
        const Eigen::Vector2d beyond_m = p_m.cwiseAbs() - Eigen::Vector2d(0.4, 0.25);
        ASSERT_NEAR(beyond_m.maxCoeff(), 0.0, 1e-9);
      } else {
        ++on_post;
        ASSERT_NEAR(p_m.cwiseQuotient(Eigen::Vector2d(0.3, 0.2)).norm(), 1.0, 1e-6);
      }
    }
  }
  EXPECT_GT(on_crate, 1000);
  EXPECT_GT(on_post, 300);
}

TEST(Shapes, ThePartsOfAThingAreOneInTruth) {
  const auto part = [](const std::string& name, const std::string& radii) {
    return object_text(name, "mocap=\"true\" pos=\"0 0 1\"", radii);
  };
  const WorldFile file(world_text(
      kRobot + "<body name=\"table_12\" mocap=\"true\" pos=\"2 1 0\" euler=\"0 0 0.5\"/>" +
          part("table_12/a", "0.05 0.05 1") + box_object("crate", "pos=\"-2 0 1\" euler=\"0 0 0.3\"", "0.4 0.25 1") +
          part("table_12/b", "0.05 0.05 1") + part("person/torso", "0.2 0.1 1") + part("person/arm", "0.1 0.1 1"),
      R"(<text name="table_12" data="straight from 2 1 velocity 0.5 0 spin 0.4"/>
         <text name="table_12/a" data="with table_12 at 0.4 0.3"/>
         <text name="table_12/b" data="with table_12 at -0.4 -0.3 appears 3"/>
         <text name="person/torso" data="straight from 0 3 velocity 0 0.8 tangent appears 1"/>
         <text name="person/arm" data="with person/torso at 0 0.3"/>)"));
  const World world(file.path());
  const std::vector<TrueThing> things = world.things_at(2.0);
  ASSERT_EQ(things.size(), 3U);
  EXPECT_EQ(things[0].name, "table_12");
  EXPECT_EQ(things[0].kind, "table");
  EXPECT_EQ(things[0].parts, (std::vector<std::size_t>{0, 2}));
  EXPECT_LT((things[0].T_world_thing.translation_m - Eigen::Vector2d(3.0, 1.0)).norm(), 1e-12);  // of its body
  EXPECT_NEAR(things[0].T_world_thing.yaw_rad, 0.5 + 0.8, 1e-12);
  EXPECT_LT((things[0].velocity_world_m_s - Eigen::Vector2d(0.5, 0.0)).norm(), 1e-12);
  EXPECT_NEAR(things[0].angular_velocity_rad_s, 0.4, 1e-12);
  EXPECT_EQ(things[1].kind, "crate");
  EXPECT_EQ(things[1].parts, (std::vector<std::size_t>{1}));
  EXPECT_NEAR(things[1].T_world_thing.yaw_rad, 0.3, 1e-12);
  EXPECT_EQ(things[2].name, "person");
  EXPECT_LT((things[2].T_world_thing.translation_m - Eigen::Vector2d(0.0, 4.6)).norm(), 1e-12);  // of its first part
  const std::vector<TrueThing> before = world.things_at(0.0);
  EXPECT_TRUE(before[0].is_there && before[1].is_there);  // a part of the table is
  EXPECT_FALSE(before[2].is_there);
}

TEST(Shapes, OutlinesOfEllipsesAreOnThemCounterClockwise) {
  const WorldFile file(world_text(kRobot + object_text("post", "pos=\"2 1 1\" euler=\"0 0 0.4\"", "0.2 0.5 1")));
  const TrueObject post = World(file.path()).objects_at(0.0)[0];
  const Polygon outline = outline_of(post);
  for (const Eigen::Vector2d& p_m : outline) {
    const Eigen::Vector2d p_post_m = inverse(post.T_world_object) * p_m;
    EXPECT_NEAR(p_post_m.cwiseQuotient(Eigen::Vector2d(0.2, 0.5)).norm(), 1.0, 1e-12);
  }
  EXPECT_NEAR(area(outline), kPi * 0.2 * 0.5, 0.01 * kPi * 0.2 * 0.5);
}

TEST(Shapes, BoxesAndMeshesAreAsTallAsTheyAre) {
  const WorldFile file(world_text(kRobot + box_object("low", "pos=\"3 0 0.4\"", "0.5 0.5 0.4") +
                                      mesh_object("slab", "pos=\"-3 0 0\"") +
                                      object_text("post", "pos=\"0 3 0.2\"", "0.3 0.3 0.2"),
                                  "", prism("slab", {{-0.5, -0.5}, {0.5, -0.5}, {0.5, 0.5}, {-0.5, 0.5}}, 0.2, 0.8)));
  World world(file.path());
  SimulatedRingScannerParams params;
  params.range_sigma_m = 0.0;
  params.elevation_min_rad = radians(-35.0);
  params.rings = 51;
  SimulatedRingScanner scanner(world, world.T_robot_lidar(), params, 1);
  const RingScannerSample sample = scanner.next();
  double highest_low = -10.0, highest_slab = -10.0, lowest_slab = 10.0, highest_post = -10.0;
  for (std::size_t i = 0; i < sample.hits.size(); ++i) {
    const double z_m = sample.cloud.points[i].z_m + 1.5;
    if (sample.hits[i].object == 0) highest_low = std::max(highest_low, z_m);
    if (sample.hits[i].object == 1)
      highest_slab = std::max(highest_slab, z_m), lowest_slab = std::min(lowest_slab, z_m);
    if (sample.hits[i].object == 2) highest_post = std::max(highest_post, z_m);
  }
  EXPECT_NEAR(highest_low, 0.8, 1e-5);  // rays come down on its top
  EXPECT_NEAR(highest_slab, 0.8, 1e-5);
  EXPECT_NEAR(lowest_slab, 0.2, 0.05);
  EXPECT_GT(highest_post, 2.0);  // a cylinder is infinitely tall, for any drawn height
}

TEST(Shapes, TheFootprintOfAMeshIsItsSectionAtHalfItsHeight) {
  // A pyramid with a square base, turned about the vertical and off the body's origin; its vertices alone.
  const WorldFile file(
      world_text(kRobot + mesh_object("tent", "pos=\"3 1 0\" euler=\"0 0 0.5\""), "",
                 R"(<asset><mesh name="tent" vertex="1 1 0  3 1 0  3 3 0  1 3 0  2 2 1.5"/></asset>)"));
  const std::vector<TrueObject> objects = World(file.path()).objects_at(0.0);
  ASSERT_EQ(objects.size(), 1U);
  expect_same_outline(objects[0].footprint_world_m,
                      placed({{1.5, 1.5}, {2.5, 1.5}, {2.5, 2.5}, {1.5, 2.5}}, {{3.0, 1.0}, 0.5}), 1e-5);
}

TEST(Shapes, ShapesWithoutAFootprintAreRefused) {
  const auto error = [](const std::string& mesh, const std::string& pose = "") {
    return error_of(
        world_text(kRobot + mesh_object("thing", pose), "", "<asset><mesh name=\"thing\" " + mesh + "/></asset>"));
  };
  EXPECT_EQ(error(R"(vertex="0 0 0  1 0 0  0 1 0  0 0 1")"), "no error");
  EXPECT_TRUE(names(error(R"(vertex="0 0 0  1 0 0  0 1 0  0 0 1")", "euler=\"0.5 0 0\""), {"thing", "upright"}));
  // Two tetrahedra one beside the other.
  EXPECT_TRUE(names(error(R"(vertex="0 0 0  1 0 0  0 1 0  0 0 1   5 0 0  6 0 0  5 1 0  5 0 1"
                             face="0 2 1  0 1 3  1 2 3  0 3 2   4 6 5  4 5 7  5 6 7  4 7 6")"),
                    {"thing", "outlines"}));
  EXPECT_TRUE(names(error(R"(vertex="0 0 0  1 0 0  0 1 0  0 0 1" face="0 2 1  0 1 3  1 2 3")"), {"thing", "closed"}));
}

}  // namespace
}  // namespace situation_awareness::shapes_test

// SPDX-License-Identifier: BSD-3-Clause
#include "situation_awareness/ros/rviz/object_mesh.hpp"

#include <algorithm>
#include <cmath>
#include <set>
#include <tuple>

#include <gtest/gtest.h>

#include "situation_awareness/common/time.hpp"
#include "situation_awareness/geometry/angles.hpp"

namespace situation_awareness::object_mesh_test {
namespace {

Object element(std::uint64_t id, const Ellipse& ellipse) {
  Object object;
  object.id = id;
  object.ellipse_world = ellipse;
  object.covariance = 1e-6 * Matrix8d::Identity();
  object.last_seen_ns = nanoseconds(10.0);
  return object;
}

Objects map_of(const std::vector<Object>& objects) {
  Objects map;
  map.stamp_ns = nanoseconds(10.0);
  map.height_world_m = 1.0;
  map.objects = objects;
  return map;
}

MapMesh drawn(const Objects& map, const ObjectStyle& style, const MapHistory& history = {}) {
  MapMesh mesh;
  add(map, history, style, mesh);
  return mesh;
}

/// Area seen from above of the triangles that lie at one height.
double area_at(const Mesh& mesh, double z_m) {
  double area = 0.0;
  for (std::size_t i = 0; i + 2 < mesh.indices.size(); i += 3) {
    const auto corner = [&mesh, i](std::size_t k) { return mesh.vertices[mesh.indices[i + k]].position_m; };
    const auto away = [&](std::size_t k) { return std::abs(corner(k).z() - static_cast<float>(z_m)) > 1e-5F; };
    if (away(0) || away(1) || away(2)) continue;
    area += 0.5 * std::abs(static_cast<double>((corner(1) - corner(0)).cross(corner(2) - corner(0)).z()));
  }
  return area;
}

TEST(ObjectMesh, FillsTheEllipseAtTheTopOfTheBody) {
  const Ellipse ellipse{{3.0, -2.0}, 0.7, 0.8, 0.3};
  ObjectStyle style;
  style.covariance = style.velocity = false;
  const MapMesh mesh = drawn(map_of({element(4, ellipse)}), style);
  EXPECT_NEAR(area_at(mesh.translucent, 1.15), kPi * 0.8 * 0.3, 0.01 * kPi * 0.8 * 0.3);
  float lowest = 10.0F;
  for (const Vertex& vertex : mesh.translucent.vertices) {
    lowest = std::min(lowest, vertex.position_m.z());
    EXPECT_TRUE(
        contains({ellipse.center_m, ellipse.psi_rad, 0.8001, 0.3001}, vertex.position_m.head<2>().cast<double>()));
  }
  EXPECT_FLOAT_EQ(lowest, 0.85F);
  for (const std::uint32_t index : mesh.translucent.indices) ASSERT_LT(index, mesh.translucent.vertices.size());
}

/// A box of 1 m by 0.4 m.
Object box(std::uint64_t id) {
  Object object = element(id, {});
  object.shape = Shape::kBox;
  object.box_world = {{3.0, -2.0}, 0.7, 0.5, 0.2};
  object.ellipse_world = moment_equal_ellipse(object.box_world);
  return object;
}

TEST(ObjectMesh, FillsABoxAndOutlinesIt) {
  ObjectStyle style;
  style.covariance = style.velocity = false;
  const MapMesh mesh = drawn(map_of({box(4)}), style);
  EXPECT_NEAR(area_at(mesh.translucent, 1.15), 1.0 * 0.4, 1e-5);
  EXPECT_NEAR(area_at(mesh.solid, 1.16), 1.06 * 0.46 - 1.0 * 0.4, 1e-5);
  for (const Vertex& vertex : mesh.translucent.vertices) {
    EXPECT_LT(offset_m(box(4).box_world, vertex.position_m.head<2>().cast<double>()), 1e-6);
  }
  Object unseen = box(4);
  unseen.last_seen_ns = nanoseconds(9.0);
  EXPECT_NEAR(area_at(drawn(map_of({unseen}), style).solid, 1.16), 2.0 / 3.0 * (1.06 * 0.46 - 1.0 * 0.4), 0.01);
}

TEST(ObjectMesh, PointsTheArrowOfABoxFromItsSide) {
  Object object = box(4);
  object.velocity_world_m_s = 2.0 * Eigen::Vector2d(std::cos(0.7), std::sin(0.7));  // along its length
  double farthest_m = 0.0;
  for (const Vertex& vertex : drawn(map_of({object}), {}).solid.vertices) {
    const Eigen::Vector2d from_center_m = vertex.position_m.head<2>().cast<double>() - object.box_world.center_m;
    farthest_m = std::max(farthest_m, from_center_m.dot(object.velocity_world_m_s.normalized()));
  }
  EXPECT_NEAR(farthest_m, 0.5 + 2.0, 1e-5);
}

TEST(ObjectMesh, OutlinesWhatIsRememberedWithDashes) {
  const Ellipse ellipse{{0.0, 0.0}, 0.0, 0.5, 0.5};
  const ObjectStyle style;
  Object seen = element(1, ellipse), unseen = seen;
  unseen.last_seen_ns = nanoseconds(9.0);
  const double whole = area_at(drawn(map_of({seen}), style).solid, 1.16);
  EXPECT_NEAR(whole, kPi * (0.53 * 0.53 - 0.5 * 0.5), 0.01 * whole);
  EXPECT_NEAR(area_at(drawn(map_of({unseen}), style).solid, 1.16), 2.0 / 3.0 * whole, 0.01 * whole);
}

TEST(ObjectMesh, PointsAnArrowToWhereTheEdgeWillBe) {
  Object object = element(1, {{1.0, 1.0}, 0.0, 0.5, 0.5});
  object.velocity_world_m_s = {0.0, 2.0};
  const auto highest_y = [](const Mesh& mesh) {
    float y = 0.0F;
    for (const Vertex& vertex : mesh.vertices) y = std::max(y, vertex.position_m.y());
    return y;
  };
  ObjectStyle style;
  EXPECT_FLOAT_EQ(highest_y(drawn(map_of({object}), style).solid), 3.5F);
  style.velocity = false;
  EXPECT_FLOAT_EQ(highest_y(drawn(map_of({object}), style).solid), 1.53F);
}

TEST(ObjectMesh, DrawsTheEllipseOfNinetyFivePercent) {
  Object object = element(1, {{0.0, 0.0}, 0.0, 0.5, 0.5});
  object.covariance(0, 0) = 0.04;
  object.covariance(1, 1) = 0.01;
  const double expected = kPi * 5.991 * 0.2 * 0.1;
  EXPECT_NEAR(area_at(drawn(map_of({object}), {}).translucent, 1.18), expected, 0.08 * expected);  // with its outline
}

TEST(ObjectMesh, LetsThePathFadeToNothing) {
  MapHistory history;
  Objects map;
  for (int i = 0; i <= 50; ++i) {
    map = map_of({element(3, {{0.1 * i, 0.0}, 0.0, 0.2, 0.2})});
    map.stamp_ns = nanoseconds(10.0 + 0.1 * i);
    history.add(map.stamp_ns, positions_of(map), 5.0);
  }
  const MapMesh mesh = drawn(map, {}, history);
  ASSERT_GE(mesh.translucent.vertices.size(), 102U);
  for (std::size_t i = 0; i <= 50; ++i) {  // the path comes first
    EXPECT_NEAR(mesh.translucent.vertices[2 * i].alpha, static_cast<double>(i) / 50.0, 1e-4);
    EXPECT_NEAR(mesh.translucent.vertices[2 * i].position_m.x(), 0.1 * static_cast<double>(i), 1e-4);
  }
}

TEST(ObjectMesh, TellsWhatMovesFromWhatStands) {
  Object object = element(1, {{0.0, 0.0}, 0.0, 0.2, 0.2});
  object.p_moving = 0.9;
  EXPECT_EQ(color_of(object, ObjectStyle::kMotion).r, kMovingColor.r);
  object.p_moving = 0.1;
  EXPECT_EQ(color_of(object, ObjectStyle::kMotion).r, kStandingColor.r);
  EXPECT_EQ(color_of(object, ObjectStyle::kId).r, color_of(std::uint64_t{1}).r);
}

TEST(ObjectMesh, EachClassHasItsColor) {
  std::set<std::tuple<float, float, float>> colors;
  Object object = element(1, {{0.0, 0.0}, 0.0, 0.2, 0.2});
  for (const ObjectClass object_class :
       {ObjectClass::kUnknown, ObjectClass::kPerson, ObjectClass::kVehicle, ObjectClass::kPole}) {
    object.object_class = object_class;
    const Color color = color_of(object, ObjectStyle::kClass);
    colors.emplace(color.r, color.g, color.b);
  }
  EXPECT_EQ(colors.size(), 4U);
}

TEST(ObjectMesh, StaysBoundedWithThousandsOfElements) {
  std::vector<Object> objects;
  for (std::uint64_t i = 0; i < 5000; ++i)
    objects.push_back(element(i, {{0.1 * static_cast<double>(i), 0.0}, 0.0, 0.2, 0.1}));
  const MapMesh mesh = drawn(map_of(objects), {});
  EXPECT_LT(mesh.translucent.vertices.size() + mesh.solid.vertices.size(), 5000U * 150U);
  EXPECT_TRUE(drawn(map_of({}), {}).translucent.indices.empty());
}

}  // namespace
}  // namespace situation_awareness::object_mesh_test

// SPDX-License-Identifier: BSD-3-Clause
#include "situation_awareness/ros/rviz/polygon_mesh.hpp"

#include <algorithm>
#include <cmath>
#include <vector>

#include <gtest/gtest.h>
#include <Eigen/Geometry>

#include "situation_awareness/ros/markers/polygon_markers.hpp"

namespace situation_awareness::polygon_mesh_test {
namespace {

/// A wall of 4 m seen from below, and a square of 1 m seen from outside.
Polygons some_chains() {
  Polygons polygons;
  polygons.stamp_ns = 1'000'000'000;
  polygons.height_world_m = 1.0;
  polygons.chains.push_back(
      {3, false, {{{2.0, 3.0}, 0.01}, {{-2.0, 3.0}, 0.02}}, 0, 1'000'000'000, 0.8, ChainState::kWall});
  polygons.chains.push_back({5,
                             true,
                             {{{0.0, 0.0}, 0.01}, {{0.0, 1.0}, 0.01}, {{1.0, 1.0}, 0.01}, {{1.0, 0.0}, 0.01}},
                             0,
                             1'000'000'000,
                             1.0,
                             ChainState::kNew});
  return polygons;
}

void draw(const Polygons& map, const PolygonStyle& style, MapMesh& mesh) {
  clear(mesh);
  for (const Chain& chain : map.chains) add(chain, color_of(chain.state), map.height_world_m, style, mesh);
}

double area_of(const Mesh& mesh) {
  double area = 0.0;
  for (std::size_t i = 0; i + 2 < mesh.indices.size(); i += 3) {
    const auto corner = [&](std::size_t k) { return mesh.vertices[mesh.indices[i + k]].position_m; };
    area += 0.5 * static_cast<double>((corner(1) - corner(0)).cross(corner(2) - corner(0)).norm());
  }
  return area;
}

TEST(PolygonMesh, WallsHaveTheLengthOfTheChains) {
  PolygonStyle style;
  style.uncertainty = false;
  MapMesh mesh;
  draw(some_chains(), style, mesh);
  EXPECT_NEAR(area_of(mesh.translucent), 0.3 * (4.0 + 4.0), 1e-5);
  float low = 10.0F, high = -10.0F;
  for (const Vertex& vertex : mesh.translucent.vertices) {
    low = std::min(low, vertex.position_m.z());
    high = std::max(high, vertex.position_m.z());
  }
  EXPECT_NEAR(low, 0.85F, 1e-6F);
  EXPECT_NEAR(high, 1.15F, 1e-6F);
  // The line is on the free side: below the wall.
  for (const Vertex& vertex : mesh.solid.vertices) {
    EXPECT_TRUE(vertex.position_m.y() < 2.0F || vertex.position_m.y() <= 3.0F + 1e-6F);
  }
}

TEST(PolygonMesh, TheBandIsFourSigmaWide) {
  PolygonStyle style;
  style.uncertainty = false;
  Polygons wall = some_chains();
  wall.chains.pop_back();
  MapMesh without, with;
  draw(wall, style, without);
  style.uncertainty = true;
  draw(wall, style, with);
  EXPECT_NEAR(area_of(with.translucent) - area_of(without.translucent), 4.0 * 4.0 * 0.015, 1e-5);
}

TEST(PolygonMesh, ColoursAreThoseOfStates) {
  std::vector<Color> colors;
  for (const ChainState state : {ChainState::kWall, ChainState::kKnown, ChainState::kNew, ChainState::kDoubted}) {
    colors.push_back(color_of(state));
  }
  for (std::size_t i = 0; i < colors.size(); ++i) {
    for (std::size_t k = 0; k < i; ++k) {
      const double apart = std::abs(colors[i].r - colors[k].r) + std::abs(colors[i].g - colors[k].g) +
                           std::abs(colors[i].b - colors[k].b);
      EXPECT_GT(apart, 0.4);
    }
  }
}

TEST(PolygonMesh, LabelsAreIdsOnTheFreeSide) {
  const std::vector<MapLabel> labels = labels_of(some_chains(), PolygonStyle());
  ASSERT_EQ(labels.size(), 2U);
  EXPECT_EQ(labels[0].text, "3");
  EXPECT_LT(labels[0].position_m.y(), 3.0F);
  EXPECT_NEAR(labels[0].position_m.x(), 0.0F, 1e-6);
  EXPECT_EQ(labels[1].text, "5");
  EXPECT_GT(labels[1].position_m.y(), 1.0F) << "outside";
}

}  // namespace
}  // namespace situation_awareness::polygon_mesh_test

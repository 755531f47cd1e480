// SPDX-License-Identifier: BSD-3-Clause
#include "situation_awareness/ros/rviz/map_mesh.hpp"

#include <cmath>

#include <gtest/gtest.h>
#include <Eigen/Geometry>

namespace situation_awareness::map_mesh_test {
namespace {

const Polyline kSquare{{1.0, 1.0}, {-1.0, 1.0}, {-1.0, -1.0}, {1.0, -1.0}, {1.0, 1.0}};  // counter-clockwise

double area_of(const Mesh& mesh) {
  double area = 0.0;
  for (std::size_t i = 0; i + 2 < mesh.indices.size(); i += 3) {
    const auto corner = [&mesh, i](std::size_t k) { return mesh.vertices[mesh.indices[i + k]].position_m; };
    area += 0.5 * static_cast<double>((corner(1) - corner(0)).cross(corner(2) - corner(0)).norm());
  }
  return area;
}

TEST(MapMesh, RightOfALineIsOnItsRightHand) {
  const Polyline right = right_of({{0.0, 0.0}, {2.0, 0.0}, {4.0, 0.0}}, 0.5);
  ASSERT_EQ(right.size(), 3U);
  for (std::size_t i = 0; i < 3; ++i)
    EXPECT_TRUE(right[i].isApprox(Eigen::Vector2d(2.0 * static_cast<double>(i), -0.5)));
}

TEST(MapMesh, RightOfAClosedLineIsClosed) {
  const Polyline outer = right_of(kSquare, std::sqrt(2.0));
  EXPECT_TRUE(outer.front().isApprox(outer.back()));
  EXPECT_TRUE(outer.front().isApprox(Eigen::Vector2d(2.0, 2.0)));
}

TEST(MapMesh, RightOfPointsThatFallTogetherIsFinite) {
  for (const Polyline& line : {Polyline{}, Polyline{{1.0, 1.0}}, Polyline(3, {1.0, 1.0})}) {
    const Polyline right = right_of(line, 1.0);
    ASSERT_EQ(right.size(), line.size());
    for (const Eigen::Vector2d& p : right) EXPECT_NEAR((p - Eigen::Vector2d(1.0, 1.0)).norm(), 1.0, 1e-12);
  }
}

TEST(MapMesh, CoversFanBandAndWall) {
  const Paint paint{{1.0F, 1.0F, 1.0F}, 0.5F};
  Mesh fan, band, dashed, wall;
  add_fan(fan, {0.0, 0.0}, kSquare, 0.0, paint);
  EXPECT_NEAR(area_of(fan), 4.0, 1e-6);
  const Polyline outer = right_of(kSquare, std::sqrt(2.0));
  add_band(band, kSquare, outer, 0.0, paint);
  EXPECT_NEAR(area_of(band), 12.0, 1e-5);
  add_band(dashed, kSquare, outer, 0.0, paint, true);
  EXPECT_NEAR(area_of(dashed), 9.0, 1e-5) << "the third of four sides is left out";
  add_wall(wall, kSquare, outer, 0.5, 1.0, paint);
  EXPECT_NEAR(area_of(wall), 4.0, 1e-6);
  for (const Vertex& vertex : wall.vertices) EXPECT_EQ(vertex.alpha, 0.5F);
}

}  // namespace
}  // namespace situation_awareness::map_mesh_test

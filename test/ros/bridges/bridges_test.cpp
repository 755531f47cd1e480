// SPDX-License-Identifier: BSD-3-Clause
#include <algorithm>
#include <cmath>
#include <map>
#include <utility>
#include <vector>

#include <gtest/gtest.h>

#include "situation_awareness/ros/bridges/costmap_converter.hpp"
#include "situation_awareness/ros/bridges/obstacle_detector.hpp"

namespace situation_awareness {
namespace {

MappedObject element(double rx_m, double ry_m, double psi_rad) {
  MappedObject result;
  result.id = 7;
  result.pose.position.x = 3.0;
  result.pose.position.y = -2.0;
  result.pose.position.z = 1.5;
  result.pose.orientation.z = std::sin(0.5 * psi_rad);
  result.pose.orientation.w = std::cos(0.5 * psi_rad);
  result.rx = rx_m;
  result.ry = ry_m;
  result.twist.linear.x = 0.4;
  result.twist.linear.y = -0.3;
  result.twist.angular.z = 0.2;
  for (std::size_t i = 0; i < 64; ++i) result.covariance[i] = 0.01 * static_cast<double>(i);
  return result;
}

MappedObjectArray map_of(const MappedObject& only) {
  MappedObjectArray map;
  map.header.frame_id = "odom";
  map.header.stamp = ros::Time(12.5);
  map.objects = {only};
  return map;
}

/// Points of the curve, in the frame of the map.
std::vector<std::pair<double, double>> outline(const MappedObject& ellipse, double psi_rad) {
  std::vector<std::pair<double, double>> points;
  for (int i = 0; i < 360; ++i) {
    const double x = ellipse.rx * std::cos(radians(i)), y = ellipse.ry * std::sin(radians(i));
    points.emplace_back(ellipse.pose.position.x + std::cos(psi_rad) * x - std::sin(psi_rad) * y,
                        ellipse.pose.position.y + std::sin(psi_rad) * x + std::cos(psi_rad) * y);
  }
  return points;
}

TEST(CostmapConverterBridge, APolygonEnclosesTheEllipseTightly) {
  const double psi_rad = 0.7;
  const MappedObject ellipse = element(0.6, 0.2, psi_rad);
  const auto array = obstacle_array_from_map(map_of(ellipse));
  ASSERT_EQ(array.obstacles.size(), 1U);
  const auto& points = array.obstacles.front().polygon.points;
  ASSERT_GT(points.size(), 2U);
  double area = 0.0;
  for (std::size_t i = 0; i < points.size(); ++i) {
    const auto &a = points[i], &b = points[(i + 1) % points.size()];
    area += 0.5 * (static_cast<double>(a.x) * b.y - static_cast<double>(b.x) * a.y);
    for (const auto& [x, y] : outline(ellipse, psi_rad)) {
      EXPECT_GE((b.x - a.x) * (y - a.y) - (b.y - a.y) * (x - a.x), -1e-6) << "left of every side";
    }
    EXPECT_FLOAT_EQ(a.z, 1.5F);
  }
  EXPECT_GT(area, kPi * 0.6 * 0.2);
  EXPECT_LT(area, 1.02 * kPi * 0.6 * 0.2);
}

TEST(CostmapConverterBridge, ARoundEllipseIsAPointWithTheRadiusThatEnclosesIt) {
  const auto array = obstacle_array_from_map(map_of(element(0.3, 0.27, 1.0)));
  const auto& obstacle = array.obstacles.front();
  ASSERT_EQ(obstacle.polygon.points.size(), 1U);
  EXPECT_FLOAT_EQ(obstacle.polygon.points.front().x, 3.0F);
  EXPECT_FLOAT_EQ(obstacle.polygon.points.front().y, -2.0F);
  EXPECT_EQ(obstacle.radius, 0.3);
}

/// A box of 0.8 m by 0.3 m whose length is along 0.7 rad; its ellipse is that of its moments.
MappedObject box() {
  MappedObject result = element(0.8 / std::sqrt(3.0), 0.3 / std::sqrt(3.0), 0.7);
  result.shape = MappedObject::BOX;
  result.box.x = 3.0;
  result.box.y = -2.0;
  result.box.theta = 0.7;
  result.box_length = 0.8;
  result.box_width = 0.3;
  return result;
}

TEST(CostmapConverterBridge, ABoxIsItsCorners) {
  const auto array = obstacle_array_from_map(map_of(box()));
  const auto& points = array.obstacles.front().polygon.points;
  ASSERT_EQ(points.size(), 4U);
  EXPECT_EQ(array.obstacles.front().radius, 0.0);
  const double sides_m[] = {0.8, 0.3, 0.8, 0.3};
  double area_m2 = 0.0, along_m = 0.0;
  for (std::size_t i = 0; i < 4; ++i) {
    const auto &a = points[i], &b = points[(i + 1) % 4];
    EXPECT_NEAR(std::hypot(b.x - a.x, b.y - a.y), sides_m[i], 1e-6);
    EXPECT_NEAR(std::hypot(a.x - 3.0, a.y + 2.0), 0.5 * std::hypot(0.8, 0.3), 1e-6);
    area_m2 += 0.5 * ((a.x - 3.0) * (b.y + 2.0) - (b.x - 3.0) * (a.y + 2.0));
    along_m = std::max(along_m, (a.x - 3.0) * std::cos(0.7) + (a.y + 2.0) * std::sin(0.7));
  }
  EXPECT_NEAR(area_m2, 0.8 * 0.3, 1e-6) << "counter-clockwise";
  EXPECT_NEAR(along_m, 0.4, 1e-6) << "its length is along theta";
}

TEST(ObstacleDetectorBridge, ACircleEnclosesABox) {
  MappedObject element = box();
  element.covariance.fill(0.0);
  const auto circle = circles_from_map(map_of(element)).circles.at(0);
  EXPECT_NEAR(circle.true_radius, 0.5 * std::hypot(0.8, 0.3), 1e-12);
  EXPECT_NEAR(circle.radius, circle.true_radius, 1e-12);
  EXPECT_EQ(circle.center, element.pose.position);
}

TEST(CostmapConverterBridge, IdFrameAndVelocityAreThoseOfTheMap) {
  const MappedObject ellipse = element(0.6, 0.2, 0.7);
  const auto array = obstacle_array_from_map(map_of(ellipse));
  const auto& obstacle = array.obstacles.front();
  EXPECT_EQ(array.header.frame_id, "odom");
  EXPECT_EQ(obstacle.header.stamp, ros::Time(12.5));
  EXPECT_EQ(obstacle.id, 7);
  EXPECT_EQ(obstacle.orientation, ellipse.pose.orientation);
  EXPECT_EQ(obstacle.velocities.twist, ellipse.twist);
  // x, y and the turn about z of a TwistWithCovariance, by their places in MappedObject.
  const std::map<std::size_t, std::size_t> place{{0, 2}, {1, 3}, {5, 5}};
  for (std::size_t i = 0; i < 6; ++i) {
    for (std::size_t j = 0; j < 6; ++j) {
      const bool known = place.count(i) != 0 && place.count(j) != 0;
      EXPECT_EQ(obstacle.velocities.covariance[6 * i + j],
                known ? ellipse.covariance[8 * place.at(i) + place.at(j)] : 0.0);
    }
  }
}

TEST(ObstacleDetectorBridge, CirclesEncloseEllipsesWithAMarginOfTheirUncertainty) {
  MappedObject ellipse = element(0.6, 0.2, 0.7);
  ellipse.covariance.fill(0.0);
  const double angle_rad = 0.4, long_sigma_m = 0.2, short_sigma_m = 0.05;
  const double c = std::cos(angle_rad), s = std::sin(angle_rad);
  const double long_variance = long_sigma_m * long_sigma_m, short_variance = short_sigma_m * short_sigma_m;
  ellipse.covariance[0] = c * c * long_variance + s * s * short_variance;
  ellipse.covariance[1] = ellipse.covariance[8] = c * s * (long_variance - short_variance);
  ellipse.covariance[9] = s * s * long_variance + c * c * short_variance;
  const auto obstacles = circles_from_map(map_of(ellipse));
  EXPECT_EQ(obstacles.header.frame_id, "odom");
  EXPECT_TRUE(obstacles.segments.empty());
  ASSERT_EQ(obstacles.circles.size(), 1U);
  const auto& circle = obstacles.circles.front();
  for (const auto& [x, y] : outline(ellipse, 0.7)) {
    EXPECT_LE(std::hypot(x - circle.center.x, y - circle.center.y), circle.true_radius + 1e-12);
  }
  EXPECT_NEAR(circle.radius, circle.true_radius + 2.4477 * long_sigma_m, 1e-4) << "sqrt of the 95 % quantile: 2.4477";
  EXPECT_EQ(circle.velocity, ellipse.twist.linear);
}

TEST(Bridges, AnEmptyMapIsNoObstacle) {
  EXPECT_TRUE(obstacle_array_from_map(MappedObjectArray()).obstacles.empty());
  EXPECT_TRUE(circles_from_map(MappedObjectArray()).circles.empty());
}

}  // namespace
}  // namespace situation_awareness

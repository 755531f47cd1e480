// SPDX-License-Identifier: BSD-3-Clause
#include "situation_awareness/sim/ring_scanner.hpp"

#include <cmath>
#include <stdexcept>
#include <string>
#include <vector>

#include <gtest/gtest.h>

#include "sim/world_file.hpp"
#include "situation_awareness/common/time.hpp"

namespace situation_awareness::ring_scanner_test {
namespace {

SimulatedRingScannerParams without_noise() {
  SimulatedRingScannerParams params;
  params.range_sigma_m = 0.0;
  params.columns = 180;
  params.azimuth_increment_rad = radians(2.0);
  return params;
}

bool has_return(const CloudPoint& point) { return !std::isnan(point.x_m); }

Eigen::Vector3d position_of(const CloudPoint& point) {
  return Eigen::Vector3f(point.x_m, point.y_m, point.z_m).cast<double>();
}

/// The direction of a point in the sensor's frame, by the rows and columns of the cloud.
Eigen::Vector3d direction(const SimulatedRingScannerParams& params, std::size_t row, std::size_t column) {
  const double elevation = params.elevation_min_rad + static_cast<double>(row) *
                                                          (params.elevation_max_rad - params.elevation_min_rad) /
                                                          (params.rings - 1);
  const double azimuth = params.azimuth_min_rad + static_cast<double>(column) * params.azimuth_increment_rad;
  return {std::cos(elevation) * std::cos(azimuth), std::cos(elevation) * std::sin(azimuth), std::sin(elevation)};
}

/// Inside a room of 10 m x 8 m x 3 m.
const std::string kRoom = R"(<geom type="plane" size="20 20 1"/>
  <geom type="box" pos="5.5 0 1.5" size="0.5 5 1.5"/> <geom type="box" pos="-5.5 0 1.5" size="0.5 5 1.5"/>
  <geom type="box" pos="0 4.5 1.5" size="5 0.5 1.5"/> <geom type="box" pos="0 -4.5 1.5" size="5 0.5 1.5"/>)";

/// Range from inside the room to its walls and floor: the nearest of five planes; none where the ray leaves above the
/// walls.
double range_in_room(const Eigen::Vector3d& origin, const Eigen::Vector3d& ray) {
  double range = std::numeric_limits<double>::infinity();
  const auto meet = [&](double distance, double speed) {
    if (speed > 0.0) range = std::min(range, distance / speed);
  };
  meet(5.0 - origin.x(), ray.x());
  meet(5.0 + origin.x(), -ray.x());
  meet(4.0 - origin.y(), ray.y());
  meet(4.0 + origin.y(), -ray.y());
  meet(origin.z(), -ray.z());
  return origin.z() + range * ray.z() > 3.0 ? std::numeric_limits<double>::infinity() : range;
}

TEST(SimulatedRingScanner, HitsTheWallsOfARoom) {
  const WorldFile file(world_text(
      kRoom + R"(<body name="robot" mocap="true"> <site name="lidar" pos="0.1 0 0.2" euler="0.1 -0.2 0.4"/> </body>)",
      R"(<text name="robot" data="circle center 0 0 radius 1.5 rate 1.5 spin 0.9"/>)"));
  World world(file.path());
  const SimulatedRingScannerParams params = without_noise();
  SimulatedRingScanner scanner(world, world.T_robot_lidar(), params, 1);
  int returns = 0, open = 0;
  for (int scan = 0; scan < 10; ++scan) {
    const double start_s = scanner.next_time_s();
    ASSERT_NEAR(start_s, 0.05 * scan, 1e-12);
    const RingScannerSample sample = scanner.next();
    ASSERT_EQ(sample.cloud.stamp_ns, nanoseconds(start_s));
    ASSERT_EQ(sample.cloud.rows, 16U);
    ASSERT_EQ(sample.cloud.columns, 180U);
    ASSERT_EQ(sample.cloud.points.size(), 16U * 180U);
    const auto T_world_sensor = [&](double time_s) {
      return world.robot_at(time_s).T_world_robot * world.T_robot_lidar();
    };
    ASSERT_TRUE(sample.T_world_sensor.isApprox(T_world_sensor(start_s), 1e-12));
    ASSERT_TRUE(sample.T_world_sensor_end.isApprox(T_world_sensor(start_s + params.sweep_s), 1e-12));
    for (std::size_t row = 0; row < 16; ++row) {
      for (std::size_t column = 0; column < 180; ++column) {
        const CloudPoint& point = sample.cloud.points[row * 180 + column];
        ASSERT_EQ(point.ring, row);
        ASSERT_NEAR(point.time_s, static_cast<double>(column) * params.sweep_s / 179.0, 1e-8);
        const Eigen::Isometry3d T = T_world_sensor(start_s + static_cast<double>(column) * params.sweep_s / 179.0);
        const Eigen::Vector3d ray_sensor = direction(params, row, column);
        const double range_m = range_in_room(T.translation(), T.linear() * ray_sensor);
        ASSERT_EQ(has_return(point), range_m < 30.0) << row << ' ' << column;
        if (!has_return(point)) {
          ++open;
          ASSERT_TRUE(std::isnan(point.y_m) && std::isnan(point.z_m) && std::isnan(point.intensity));
          continue;
        }
        ++returns;
        ASSERT_LT((position_of(point) - range_m * ray_sensor).norm(), 1e-5) << row << ' ' << column;
      }
    }
  }
  EXPECT_GT(returns, 10 * 2000);
  EXPECT_GT(open, 10 * 100);
}

TEST(SimulatedRingScanner, HasRingsFromTheLowestToTheHighest) {
  const WorldFile file(world_text(kRoom + kRobot));
  World world(file.path());
  SimulatedRingScannerParams params = without_noise();
  params.elevation_min_rad = radians(-25.0);
  params.elevation_max_rad = radians(10.0);
  params.rings = 8;
  params.azimuth_min_rad = radians(40.0);
  params.azimuth_increment_rad = radians(-1.0);
  params.columns = 81;
  params.sweep_s = 0.0;
  SimulatedRingScanner scanner(world, world.T_robot_lidar(), params, 1);
  const Cloud cloud = scanner.next().cloud;
  for (std::size_t i = 0; i < cloud.points.size(); ++i) {
    const CloudPoint& point = cloud.points[i];
    ASSERT_TRUE(has_return(point)) << i;
    EXPECT_NEAR(std::atan2(point.z_m, std::hypot(point.x_m, point.y_m)), radians(-25.0 + 5.0 * point.ring), 1e-6);
    EXPECT_NEAR(std::atan2(point.y_m, point.x_m), radians(40.0 - static_cast<double>(i % 81)), 1e-6);
    EXPECT_EQ(point.ring, i / 81);
    EXPECT_EQ(point.time_s, 0.0F);
  }
  params.rings = 1;
  params.elevation_min_rad = params.elevation_max_rad = 0.0;
  const Cloud flat = SimulatedRingScanner(world, world.T_robot_lidar(), params, 1).next().cloud;
  ASSERT_EQ(flat.points.size(), 81U);
  for (const CloudPoint& point : flat.points) EXPECT_NEAR(point.z_m, 0.0, 1e-6);
}

TEST(SimulatedRingScanner, KeepsToItsLimitsAndItsNoiseIsAlongTheRay) {
  const WorldFile file(world_text(kRoom + kRobot));
  World world(file.path());
  SimulatedRingScannerParams params = without_noise();
  params.range_min_m = 4.05;
  params.range_max_m = 5.5;
  params.range_sigma_m = 0.02;
  SimulatedRingScanner noisy(world, world.T_robot_lidar(), params, 3);
  double sum = 0.0, sum_of_squares = 0.0;
  int n = 0;
  for (int scan = 0; scan < 40; ++scan) {
    const Cloud cloud = noisy.next().cloud;
    for (std::size_t i = 0; i < cloud.points.size(); ++i) {
      const Eigen::Vector3d ray = direction(params, i / 180, i % 180);
      const double truth_m = range_in_room({0.0, 0.0, 1.5}, ray);
      const CloudPoint& point = cloud.points[i];
      if (std::abs(truth_m - params.range_min_m) > 1e-9) {
        ASSERT_EQ(has_return(point), truth_m >= params.range_min_m && truth_m <= params.range_max_m)
            << i << ' ' << truth_m;
      }
      if (!has_return(point)) continue;
      const double range_m = position_of(point).norm();
      ASSERT_LT((position_of(point) - range_m * ray).norm(), 1e-6);
      ASSERT_GE(range_m, params.range_min_m - 1e-6);
      ASSERT_LE(range_m, params.range_max_m + 1e-6);
      if (truth_m < params.range_min_m + 0.15 || truth_m > params.range_max_m - 0.15) continue;  // not cut off
      const double z = (range_m - truth_m) / params.range_sigma_m;
      sum += z;
      sum_of_squares += z * z;
      ++n;
    }
  }
  ASSERT_GT(n, 10000);
  EXPECT_LT(std::abs(sum), 4.0 * std::sqrt(n));
  EXPECT_LT(std::abs(sum_of_squares - n), 4.0 * std::sqrt(2.0 * n));
}

TEST(SimulatedRingScanner, GivesTheSameWithTheSameSeed) {
  World world(kWorlds + "demo.xml");
  SimulatedRingScannerParams params;
  params.columns = 90;
  params.azimuth_increment_rad = radians(4.0);
  SimulatedRingScanner a(world, world.T_robot_lidar(), params, 11), b(world, world.T_robot_lidar(), params, 11),
      c(world, world.T_robot_lidar(), params, 12);
  int differ = 0, same = 0;
  for (int scan = 0; scan < 5; ++scan) {
    const Cloud from_a = a.next().cloud, from_b = b.next().cloud, from_c = c.next().cloud;
    for (std::size_t i = 0; i < from_a.points.size(); ++i) {
      ASSERT_EQ(has_return(from_a.points[i]), has_return(from_b.points[i]));
      if (!has_return(from_a.points[i])) continue;
      ASSERT_EQ(position_of(from_a.points[i]), position_of(from_b.points[i]));
      ++(position_of(from_a.points[i]) == position_of(from_c.points[i]) ? same : differ);
    }
  }
  EXPECT_GT(differ, 1000);
  EXPECT_LT(same, differ / 100);
}

TEST(SimulatedRingScanner, ReturnsTheObjectsThatItHits) {
  const WorldFile file(world_text(kRobot + object_text("post", "pos=\"2.3 0 1\"", "0.3 0.3 1") +
                                  object_text("pole", "pos=\"-4 0 1\"", "0.2 0.2 1")));
  World world(file.path());
  SimulatedRingScanner scanner(world, world.T_robot_lidar(), without_noise(), 1);
  const RingScannerSample sample = scanner.next();
  Sightings sightings(world.names().size());
  const std::vector<int> objects = sightings.add(sample.cloud.stamp_ns, sample.hits, sample.cloud.columns);
  int returns = 0;
  for (std::size_t i = 0; i < objects.size(); ++i) {
    const CloudPoint& point = sample.cloud.points[i];
    ASSERT_EQ(objects[i] >= 0, has_return(point));
    if (!has_return(point)) continue;
    ++returns;
    ASSERT_EQ(objects[i], point.x_m > 0.0F ? 0 : 1);
    ASSERT_NEAR(sample.hits[i].range_m, position_of(point).norm(), 1e-5);
  }
  EXPECT_EQ(returns, 16 * 10);
  // Columns of 2 deg within the outline's half angle, asin(radius / distance): 7.5 deg and 2.9 deg.
  EXPECT_EQ(sightings.of_object()[0].beams, 7);
  EXPECT_EQ(sightings.of_object()[1].beams, 3);
}

TEST(SimulatedRingScanner, RefusesBadParamsNamingFieldAndBound) {
  World world(kWorlds + "single.xml");
  const auto message = [&](const SimulatedRingScannerParams& params) {
    return refusal_of([&] { SimulatedRingScanner(world, world.T_robot_lidar(), params, 0); });
  };
  SimulatedRingScannerParams params;
  EXPECT_EQ(message(params), "");
  params.rings = 0;
  EXPECT_TRUE(names(message(params), {"ring_scanner.rings", "0", "1", "256"}));
  params = {};
  params.elevation_max_rad = -0.5;
  EXPECT_TRUE(names(message(params), {"ring_scanner.elevation_max_rad"}));
  params = {};
  params.columns = 901;
  EXPECT_TRUE(names(message(params), {"ring_scanner.columns"}));
  params = {};
  params.azimuth_increment_rad = 0.0;
  EXPECT_TRUE(names(message(params), {"ring_scanner.azimuth_increment_rad"}));
  params = {};
  params.rate_hz = 30.0;
  EXPECT_TRUE(names(message(params), {"ring_scanner.sweep_s"}));
  params = {};
  params.range_max_m = 0.05;
  EXPECT_TRUE(names(message(params), {"ring_scanner.range_max_m"}));
}

}  // namespace
}  // namespace situation_awareness::ring_scanner_test

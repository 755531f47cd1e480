// SPDX-License-Identifier: BSD-3-Clause
#include "situation_awareness/scan/cloud_slice.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <functional>
#include <limits>
#include <stdexcept>
#include <vector>

#include "situation_awareness/common/random.hpp"
#include "situation_awareness/geometry/angles.hpp"
#include "situation_awareness/geometry/ellipse.hpp"

namespace situation_awareness::cloud_slice_test {
namespace {

constexpr double kInfinity = std::numeric_limits<double>::infinity();
constexpr double kRange_m = 12.0;  // of the scan, by default

/// Vertical cylinders on a floor, the world's plane z = 0.
struct Scene {
  std::vector<Ellipse> cylinders;
  bool floor = true;

  double range_m(const Eigen::Vector3d& from, const Eigen::Vector3d& direction) const {
    const double horizontal = direction.head<2>().norm();
    double nearest_m = floor && direction.z() < 0.0 ? -from.z() / direction.z() : kInfinity;
    for (const Ellipse& cylinder : cylinders) {
      if (horizontal < 1e-9) continue;
      const auto hit = intersect_ray(cylinder, from.head<2>(), direction.head<2>() / horizontal);
      if (hit) nearest_m = std::min(nearest_m, *hit / horizontal);
    }
    return nearest_m;
  }

  /// Of a point in the world from the nearest cylinder, horizontally.
  double distance_m(const Eigen::Vector2d& p) const {
    double nearest_m = kInfinity;
    for (const Ellipse& cylinder : cylinders) {
      for (int i = 0; i < 3600; ++i) {
        const double angle_rad = radians(0.1 * i);
        const Eigen::Vector2d on = cylinder.center_m + Eigen::Rotation2Dd(cylinder.psi_rad) *
                                                           Eigen::Vector2d(cylinder.rx_m * std::cos(angle_rad),
                                                                           cylinder.ry_m * std::sin(angle_rad));
        nearest_m = std::min(nearest_m, (on - p).norm());
      }
    }
    return nearest_m;
  }
};

Scene some_cylinders() {
  Scene scene;
  scene.cylinders = {{{3.0, 0.5}, 0.4, 0.4, 0.2},
                     {{-2.0, 2.0}, 0.0, 0.3, 0.3},
                     {{-4.0, -3.0}, 1.0, 0.5, 0.3},
                     {{1.0, -5.0}, 0.0, 0.4, 0.4},
                     {{0.5, 4.0}, 2.0, 0.2, 0.15}};
  return scene;
}

using PoseAt = std::function<Eigen::Isometry3d(double time_s)>;

PoseAt still(const Eigen::Isometry3d& T_world_sensor) {
  return [T_world_sensor](double /*time_s*/) { return T_world_sensor; };
}

void measure(const Scene& scene, const Eigen::Isometry3d& T_world_sensor, const Eigen::Vector3d& ray_sensor,
             double time_s, Cloud& cloud, double max_range_m = 30.0) {
  CloudPoint point;
  point.time_s = static_cast<float>(time_s);
  const double range_m = scene.range_m(T_world_sensor.translation(), T_world_sensor.linear() * ray_sensor);
  if (range_m <= max_range_m) {
    const Eigen::Vector3f p = (range_m * ray_sensor).cast<float>();
    point.x_m = p.x();
    point.y_m = p.y();
    point.z_m = p.z();
  }
  cloud.points.push_back(point);
}

constexpr std::size_t kColumns = 900;

/// 16 rings 2 degrees apart; `sweep_s` from the first column to the last.
Cloud ring_cloud(const Scene& scene, const PoseAt& T_world_sensor_at, double sweep_s = 0.0, double first_s = 0.0,
                 int direction = 1) {
  Cloud cloud;
  cloud.stamp_ns = 5'000'000'000;
  cloud.rows = 16;
  cloud.columns = kColumns;
  for (std::size_t row = 0; row < cloud.rows; ++row) {
    const double elevation_rad = radians(-15.0 + 2.0 * static_cast<double>(row));
    for (std::size_t column = 0; column < kColumns; ++column) {
      const double azimuth_rad = direction * radians(-180.0 + 0.4 * static_cast<double>(column));
      const double time_s = first_s + sweep_s * static_cast<double>(column) / (kColumns - 1);
      measure(scene, T_world_sensor_at(time_s),
              {std::cos(elevation_rad) * std::cos(azimuth_rad), std::cos(elevation_rad) * std::sin(azimuth_rad),
               std::sin(elevation_rad)},
              time_s, cloud);
    }
  }
  return cloud;
}

/// A pinhole in the frame of images: x to the right, y down, z ahead.
Cloud camera_cloud(const Scene& scene, const Eigen::Isometry3d& T_world_camera) {
  Cloud cloud;
  cloud.rows = 90;
  cloud.columns = 160;
  for (std::size_t row = 0; row < cloud.rows; ++row) {
    for (std::size_t column = 0; column < cloud.columns; ++column) {
      const Eigen::Vector3d ray((static_cast<double>(column) - 79.5) / 120.0, (static_cast<double>(row) - 44.5) / 120.0,
                                1.0);
      measure(scene, T_world_camera, ray.normalized(), 0.0, cloud, kRange_m);
    }
  }
  return cloud;
}

Cloud without_structure(const Cloud& cloud) {
  Cloud result;
  result.stamp_ns = cloud.stamp_ns;
  for (const CloudPoint& point : cloud.points) {
    if (!std::isnan(point.x_m)) result.points.push_back(point);
  }
  result.columns = result.points.size();
  return result;
}

Eigen::Isometry3d pose(double x_m, double y_m, double z_m, double roll_rad = 0.0, double pitch_rad = 0.0,
                       double yaw_rad = 0.0) {
  Eigen::Isometry3d T = Eigen::Isometry3d::Identity();
  T.translation() << x_m, y_m, z_m;
  T.rotate(Eigen::AngleAxisd(yaw_rad, Eigen::Vector3d::UnitZ()) *
           Eigen::AngleAxisd(pitch_rad, Eigen::Vector3d::UnitY()) *
           Eigen::AngleAxisd(roll_rad, Eigen::Vector3d::UnitX()));
  return T;
}

CloudSlice slice(const Cloud& cloud, const Eigen::Isometry3d& T_world_sensor, const CloudSliceParams& params = {}) {
  return slice_cloud(cloud, T_world_sensor, T_world_sensor, params);
}

double bearing_rad(const Scan& scan, std::size_t beam) {
  return scan.angle_min_rad + static_cast<double>(beam) * scan.angle_increment_rad;
}

Eigen::Vector2d hit_world(const CloudSlice& slice, std::size_t beam) {
  const double angle_rad = bearing_rad(slice.scan, beam);
  const double range_m = slice.scan.beams[beam].range_m;
  return (slice.T_world_level * Eigen::Vector3d(range_m * std::cos(angle_rad), range_m * std::sin(angle_rad), 0.0))
      .head<2>();
}

void expect_same(const Scan& a, const Scan& b) {
  ASSERT_EQ(a.beams.size(), b.beams.size());
  for (std::size_t i = 0; i < a.beams.size(); ++i) {
    EXPECT_EQ(a.beams[i].state, b.beams[i].state) << i;
    EXPECT_NEAR(a.beams[i].range_m, b.beams[i].range_m, 1e-5) << i;
  }
}

TEST(CloudSlice, OfALevelRingScannerIsTheScanOfA2dScanner) {
  const Scene scene = some_cylinders();
  const Eigen::Isometry3d T_world_sensor = pose(0.2, -0.1, 1.5, 0.0, 0.0, 0.3);
  const CloudSlice slice = cloud_slice_test::slice(ring_cloud(scene, still(T_world_sensor)), T_world_sensor);
  ASSERT_EQ(slice.scan.beams.size(), kColumns);
  EXPECT_EQ(slice.scan.stamp_ns, 5'000'000'000);
  EXPECT_EQ(slice.scan.time_increment_s, 0.0);
  EXPECT_STREQ(scan_defect(slice.scan), "");
  EXPECT_LT((slice.T_world_level.matrix() - T_world_sensor.matrix()).norm(), 1e-12);
  int hits = 0, free = 0;
  for (std::size_t i = 0; i < kColumns; ++i) {
    const double angle_rad = bearing_rad(slice.scan, i);
    const Eigen::Vector3d ray_world =
        T_world_sensor.linear() * Eigen::Vector3d(std::cos(angle_rad), std::sin(angle_rad), 0.0);
    const double range_m = scene.range_m(T_world_sensor.translation(), ray_world);
    const Beam& beam = slice.scan.beams[i];
    if (range_m < kRange_m) {
      EXPECT_EQ(beam.state, BeamState::kHit) << i;
      EXPECT_NEAR(beam.range_m, range_m, 1e-5) << i;
      ++hits;
    } else {
      EXPECT_EQ(beam.state, BeamState::kFree) << i;
      EXPECT_EQ(beam.range_m, static_cast<float>(kRange_m));
      ++free;
    }
  }
  EXPECT_GT(hits, 50);
  EXPECT_GT(free, 500);
}

TEST(CloudSlice, OfADepthCameraSeesWhatIsAheadAndKnowsNothingOfTheRest) {
  Scene scene = some_cylinders();
  scene.cylinders.push_back({{4.0, -2.0}, 0.0, 0.3, 0.3});
  Eigen::Isometry3d T_robot_camera = Eigen::Isometry3d::Identity();
  T_robot_camera.linear() << 0, 0, 1, -1, 0, 0, 0, -1, 0;  // z ahead, x to the right
  for (const double pitch_rad : {0.0, 0.15}) {
    const Eigen::Isometry3d T_world_camera = pose(0.0, 0.0, 1.2, 0.0, pitch_rad, 0.1) * T_robot_camera;
    CloudSliceParams params;
    params.angle_increment_rad = radians(0.6);
    const CloudSlice slice = cloud_slice_test::slice(camera_cloud(scene, T_world_camera), T_world_camera, params);
    int hits = 0, free = 0;
    for (std::size_t i = 0; i < slice.scan.beams.size(); ++i) {
      const Beam& beam = slice.scan.beams[i];
      const double angle_rad = bearing_rad(slice.scan, i);
      const Eigen::Vector3d ahead = slice.T_world_level.linear().transpose() * T_world_camera.linear().col(2);
      const double off_rad = std::abs(wrap_to_pi(angle_rad - std::atan2(ahead.y(), ahead.x())));
      const double half_view_rad = std::atan(79.5 / 120.0);
      if (off_rad > half_view_rad + radians(3.0)) {
        EXPECT_EQ(beam.state, BeamState::kInvalid) << degrees(off_rad);
      } else if (off_rad < half_view_rad - radians(3.0)) {
        EXPECT_NE(beam.state, BeamState::kInvalid) << degrees(off_rad);
      }
      free += beam.state == BeamState::kFree ? 1 : 0;
      if (beam.state != BeamState::kHit) continue;
      ++hits;
      EXPECT_LT(scene.distance_m(hit_world(slice, i)), 0.5 * beam.range_m * params.angle_increment_rad + 1e-3);
    }
    EXPECT_GT(hits, 15);
    EXPECT_GT(free, 30);
  }
}

// Only what was hit can be known: where nothing was, nobody looked, and what goes past an edge is not known to.
TEST(CloudSlice, WithoutStructureHasTheSameHitsAndNothingFree) {
  Scene scene = some_cylinders();
  scene.floor = false;
  const Eigen::Isometry3d T_world_sensor = pose(0.2, -0.1, 1.5, 0.05, 0.1, 0.3);
  const Cloud cloud = ring_cloud(scene, still(T_world_sensor));
  const CloudSlice structured = slice(cloud, T_world_sensor);
  const CloudSlice unstructured = slice(without_structure(cloud), T_world_sensor);
  int hits = 0, beside_edges = 0, free = 0;
  for (std::size_t i = 0; i < kColumns; ++i) {
    const Beam& a = structured.scan.beams[i];
    const Beam& b = unstructured.scan.beams[i];
    EXPECT_NE(b.state, BeamState::kFree);
    free += a.state == BeamState::kFree ? 1 : 0;
    if (a.state != BeamState::kHit) {
      beside_edges += b.state == BeamState::kHit ? 1 : 0;
      continue;
    }
    EXPECT_EQ(b.state, BeamState::kHit);
    EXPECT_NEAR(a.range_m, b.range_m, 0.02);
    ++hits;
  }
  EXPECT_GT(hits, 50);
  EXPECT_GT(free, 500);
  EXPECT_LE(beside_edges, 2 * static_cast<int>(scene.cylinders.size()));
}

TEST(CloudSlice, SeesVerticalThingsTheSameHoweverTheSensorTilts) {
  const Scene scene = some_cylinders();
  for (const auto& [roll_rad, pitch_rad] : {std::pair{0.1, 0.0}, {0.0, -0.15}, {0.12, 0.12}, {kPi, 0.1}}) {
    const Eigen::Isometry3d T_world_sensor = pose(0.2, -0.1, 1.5, roll_rad, pitch_rad, 0.3);
    const CloudSlice slice = cloud_slice_test::slice(ring_cloud(scene, still(T_world_sensor)), T_world_sensor);
    EXPECT_NEAR(slice.T_world_level.linear()(2, 2), 1.0, 1e-12);
    int hits = 0, free = 0;
    for (std::size_t i = 0; i < kColumns; ++i) {
      const Beam& beam = slice.scan.beams[i];
      const double angle_rad = bearing_rad(slice.scan, i);
      const Eigen::Vector3d ray_world =
          slice.T_world_level.linear() * Eigen::Vector3d(std::cos(angle_rad), std::sin(angle_rad), 0.0);
      if (beam.state == BeamState::kFree) {
        ++free;
        // Nothing there, but for half a bearing at an edge.
        const Eigen::Vector3d right = Eigen::AngleAxisd(-radians(0.25), Eigen::Vector3d::UnitZ()) * ray_world;
        const Eigen::Vector3d left = Eigen::AngleAxisd(radians(0.25), Eigen::Vector3d::UnitZ()) * ray_world;
        EXPECT_GT(std::max(scene.range_m(T_world_sensor.translation(), right),
                           scene.range_m(T_world_sensor.translation(), left)),
                  kRange_m);
      }
      if (beam.state != BeamState::kHit) continue;
      ++hits;
      EXPECT_LT(scene.distance_m(hit_world(slice, i)), 0.5 * beam.range_m * radians(0.4) + 5e-3) << i;
    }
    EXPECT_GT(hits, 50);
    EXPECT_GT(free, 400);
  }
}

TEST(CloudSlice, MovesWithTheWorld) {
  const Scene scene = some_cylinders();
  const Eigen::Isometry3d T_world_sensor = pose(0.2, -0.1, 1.5, 0.1, 0.05, 0.3);
  const CloudSlice before = slice(ring_cloud(scene, still(T_world_sensor)), T_world_sensor);
  const Eigen::Isometry3d motion = pose(7.0, -4.0, 2.0, 0.0, 0.0, 2.1);
  const CloudSlice after = slice(ring_cloud(scene, still(T_world_sensor)), motion * T_world_sensor);
  expect_same(before.scan, after.scan);
  EXPECT_LT((after.T_world_level.matrix() - (motion * before.T_world_level).matrix()).norm(), 1e-9);
}

// A sensor that flies and turns while it sweeps: every hit lies where the cylinder is, in the frame of the stamp, and
// each beam has the time of its column.
TEST(CloudSlice, TakesEveryPointAtItsOwnTime) {
  const Scene scene = some_cylinders();
  constexpr double kSweep_s = 0.1;
  for (const int direction : {1, -1}) {
    for (const double first_s : {0.0, -kSweep_s, 0.02}) {
      const Eigen::Isometry3d T_world_sensor = pose(0.2, -0.1, 1.5, 0.05, 0.1, 0.3);
      const PoseAt moving = [&](double time_s) {
        const double t = time_s - first_s;
        return pose(2.0 * t, -1.0 * t, 0.5 * t) * T_world_sensor * pose(0.0, 0.0, 0.0, 0.5 * t, 0.0, 1.0 * t);
      };
      const Cloud cloud = ring_cloud(scene, moving, kSweep_s, first_s, direction);
      const CloudTimes times = times_of(cloud).value();
      EXPECT_NEAR(times.first_s, first_s, 1e-6);
      EXPECT_NEAR(times.last_s, first_s + kSweep_s, 1e-6);
      const CloudSlice slice = slice_cloud(cloud, moving(times.first_s), moving(times.last_s), {});
      EXPECT_NEAR(static_cast<double>(slice.scan.stamp_ns), 5e9 + 1e9 * first_s, 1e3);
      EXPECT_EQ(slice.scan.angle_increment_rad > 0.0, direction > 0);
      // It turns by 0.1 rad with its sweep or against it.
      EXPECT_NEAR(slice.scan.time_increment_s * (kColumns - 1), kSweep_s / (1.0 + direction * 0.1 / (2.0 * kPi)), 1e-3);
      int hits = 0;
      for (std::size_t i = 0; i < slice.scan.beams.size(); ++i) {
        const Beam& beam = slice.scan.beams[i];
        if (beam.state != BeamState::kHit) continue;
        ++hits;
        const Eigen::Vector2d p_world = hit_world(slice, i);
        EXPECT_LT(scene.distance_m(p_world), 0.5 * beam.range_m * radians(0.4) + 6e-3) << i;
        // When the beam looked there: a sweep begins behind the sensor.
        const double time_s = static_cast<double>(i) * slice.scan.time_increment_s;
        const Eigen::Vector3d seen =
            moving(first_s + time_s).inverse() * Eigen::Vector3d(p_world.x(), p_world.y(), 1.5 + 0.5 * time_s);
        const double column = (direction * std::atan2(seen.y(), seen.x()) + kPi) / radians(0.4);
        EXPECT_NEAR(column / (kColumns - 1) * kSweep_s, time_s, 0.003);
      }
      EXPECT_GT(hits, 50);
    }
  }
}

// Drivers have no time, or any, where there is no return: what such measurements see free is as with good times.
TEST(CloudSlice, TimesOfPointsWithoutAReturnDoNotMatter) {
  const Scene scene = some_cylinders();
  const PoseAt moving = [](double time_s) { return pose(2.0 * time_s, 0.0, 1.5, 0.0, 0.0, 1.1 * time_s); };
  const Cloud good = ring_cloud(scene, moving, 0.1);
  Cloud without = good;
  std::size_t returns = 0;
  for (CloudPoint& point : without.points) {
    if (is_return(point)) {
      ++returns;
    } else {
      point.time_s = std::nanf("");
    }
  }
  ASSERT_LT(returns, good.points.size());
  const CloudTimes times = times_of(without).value();
  const CloudSlice of_good = slice_cloud(good, moving(0.0), moving(0.1), {});
  const CloudSlice slice = slice_cloud(without, moving(times.first_s), moving(times.last_s), {});
  EXPECT_TRUE(slice.times_valid);
  EXPECT_EQ(slice.untimed_returns, 0U);
  std::size_t hits = 0;
  for (std::size_t i = 0; i < slice.scan.beams.size(); ++i) {
    if (slice.scan.beams[i].state != BeamState::kHit) continue;
    ++hits;
    EXPECT_LT(scene.distance_m(hit_world(slice, i)), 0.5 * slice.scan.beams[i].range_m * radians(0.4) + 6e-3);
  }
  const auto count = [](const Scan& scan, BeamState state) {
    return static_cast<double>(
        std::count_if(scan.beams.begin(), scan.beams.end(), [state](const Beam& beam) { return beam.state == state; }));
  };
  EXPECT_NEAR(static_cast<double>(hits), count(of_good.scan, BeamState::kHit), 3.0);
  EXPECT_NEAR(count(slice.scan, BeamState::kFree), count(of_good.scan, BeamState::kFree), 0.05 * kColumns);
}

TEST(CloudSlice, ReturnsWithoutATimeAreLeftOut) {
  const Scene scene = some_cylinders();
  const PoseAt moving = [](double time_s) { return pose(2.0 * time_s, 0.0, 1.5, 0.0, 0.0, 1.1 * time_s); };
  Cloud cloud = ring_cloud(scene, moving, 0.1);
  const CloudSlice before = slice_cloud(cloud, moving(0.0), moving(0.1), {});
  std::size_t untimed = 0;
  for (std::size_t i = 0; i < cloud.points.size() && untimed < 3; i += 61) {
    if (!is_return(cloud.points[i])) continue;
    cloud.points[i].time_s = std::nanf("");
    ++untimed;
  }
  const CloudSlice slice = slice_cloud(cloud, moving(0.0), moving(0.1), {});
  EXPECT_TRUE(slice.times_valid);
  EXPECT_EQ(slice.untimed_returns, 3U);
  EXPECT_NEAR(slice.duration_s, 0.1, 1e-6);
  std::size_t other = 0;
  for (std::size_t i = 0; i < slice.scan.beams.size(); ++i) {
    other += std::abs(slice.scan.beams[i].range_m - before.scan.beams[i].range_m) > 1e-3F ? 1 : 0;
  }
  EXPECT_LE(other, 3U);
}

TEST(UntimedMotion, IsOfSweepsWithoutTimesAlone) {
  const Scene scene = some_cylinders();
  const auto clouds_off = [&](double sweep_s, double speed_m_s, double rate_rad_s, bool is_camera) {
    UntimedMotion motion;
    for (int k = 0; k < 5; ++k) {
      const PoseAt moving = [&](double time_s) {
        return pose(speed_m_s * (0.1 * k + time_s), 0.0, 1.5, 0.0, 0.0, rate_rad_s * (0.1 * k + time_s));
      };
      Cloud cloud = ring_cloud(scene, moving, sweep_s);
      cloud.stamp_ns += 100'000'000 * k;
      if (is_camera) {
        for (CloudPoint& point : cloud.points) {
          if (!(point.x_m > 0.0F)) point = {};
        }
        cloud = without_structure(cloud);
      }
      motion.add(slice_cloud(cloud, moving(0.0), moving(sweep_s), {}), moving(0.0), {});
    }
    return motion;
  };
  EXPECT_EQ(clouds_off(0.0, 2.0, 0.0, false).clouds(), 4U);
  EXPECT_NEAR(clouds_off(0.0, 2.0, 0.0, false).most_m(), 0.2, 1e-6);
  EXPECT_EQ(clouds_off(0.0, 0.0, 1.0, false).clouds(), 4U);
  EXPECT_EQ(clouds_off(0.0, 0.1, 0.001, false).clouds(), 0U);
  EXPECT_EQ(clouds_off(0.1, 2.0, 1.0, false).clouds(), 0U);
  EXPECT_EQ(clouds_off(0.0, 2.0, 1.0, true).clouds(), 0U);
}

TEST(CloudSlice, WithoutASweepHasNoTimes) {
  Random random(1);
  const Scene scene = some_cylinders();
  const Eigen::Isometry3d T_world_sensor = pose(0.0, 0.0, 1.5);
  Cloud cloud = ring_cloud(scene, still(T_world_sensor));
  for (CloudPoint& point : cloud.points) point.time_s = static_cast<float>(random.uniform(0.0, 0.1));
  const CloudSlice slice = cloud_slice_test::slice(cloud, T_world_sensor);
  EXPECT_EQ(slice.scan.time_increment_s, 0.0);
  for (CloudPoint& point : cloud.points) point.time_s = std::nanf("");
  EXPECT_FALSE(times_of(cloud));
  const CloudSlice ignored = cloud_slice_test::slice(cloud, T_world_sensor);
  EXPECT_TRUE(slice.times_valid);
  EXPECT_FALSE(ignored.times_valid);
  expect_same(ignored.scan, slice.scan);
}

CloudPoint point_at(double azimuth_rad, double range_m, double z_m, float intensity = 0.0F) {
  CloudPoint point;
  point.x_m = static_cast<float>(range_m * std::cos(azimuth_rad));
  point.y_m = static_cast<float>(range_m * std::sin(azimuth_rad));
  point.z_m = static_cast<float>(z_m);
  point.intensity = intensity;
  return point;
}

TEST(CloudSlice, TakesTheNearestSurfaceBetweenItsHeights) {
  Cloud cloud;
  // At 0 degrees: the floor, the ceiling, two hits of one surface in the slice, one of a surface behind.
  for (const auto& [range_m, z_m, intensity] :
       {std::tuple{1.0, -0.5, 9.0F}, {1.5, 0.4, 9.0F}, {4.0, 0.0, 9.0F}, {3.03, 0.1, 30.0F}, {3.01, -0.1, 10.0F}}) {
    cloud.points.push_back(point_at(0.0, range_m, z_m, intensity));
  }
  cloud.points.push_back(point_at(1.0, 20.0, 0.1));   // beyond the range: free
  cloud.points.push_back(point_at(2.0, 5.0, -1.5));   // the floor: not looked at level
  cloud.points.push_back(point_at(-1.0, 0.05, 0.0));  // the robot itself
  cloud.columns = cloud.points.size();
  const CloudSlice slice = cloud_slice_test::slice(cloud, Eigen::Isometry3d::Identity());
  const auto beam_at = [&](double angle_rad) {
    const double at = (angle_rad - slice.scan.angle_min_rad) / slice.scan.angle_increment_rad;
    return slice.scan.beams[static_cast<std::size_t>(std::lround(at))];
  };
  EXPECT_EQ(beam_at(0.0).state, BeamState::kHit);
  EXPECT_NEAR(beam_at(0.0).range_m, 3.02, 1e-6);
  EXPECT_NEAR(beam_at(0.0).intensity, 20.0, 1e-6);
  EXPECT_EQ(beam_at(1.0).state, BeamState::kFree);
  EXPECT_EQ(beam_at(2.0).state, BeamState::kInvalid);
  EXPECT_EQ(beam_at(-1.0).state, BeamState::kInvalid);
  EXPECT_EQ(beam_at(3.0).state, BeamState::kInvalid);
}

// Half of a bearing is a post, seen by three rings, half a wall behind it, where two of them have left the slice. The
// ring that is still in it and nearer to the middle decides, whichever of the two it meets.
TEST(CloudSlice, WhatIsInTheMiddleOfABearingCountsAtAnEdge) {
  for (const bool post_in_middle : {true, false}) {
    Cloud cloud;
    const double beside_rad = radians(0.15);
    cloud.points.push_back(point_at(beside_rad, 3.0, 0.2));  // would leave the slice 4.5 m away
    cloud.points.push_back(point_at(-beside_rad, 3.0, -0.2));
    cloud.points.push_back(post_in_middle ? point_at(radians(0.05), 3.0, 0.0) : point_at(radians(0.05), 8.0, 0.0));
    cloud.columns = cloud.points.size();
    const CloudSlice slice = cloud_slice_test::slice(cloud, Eigen::Isometry3d::Identity());
    const Beam& beam = slice.scan.beams[kColumns / 2];
    EXPECT_EQ(beam.state, BeamState::kHit);
    EXPECT_NEAR(beam.range_m, post_in_middle ? 3.0 : 8.0, 1e-6);
  }
}

// Some drivers have a row for each column of the sensor, and a sensor of any kind may have rows and columns without any
// return: what lies between and beside those with returns follows.
TEST(CloudSlice, KnowsDirectionsByRowAndColumn) {
  Scene scene = some_cylinders();
  const Eigen::Isometry3d T_world_sensor = pose(0.2, -0.1, 1.5, 0.05, 0.1, 0.3);
  const Cloud cloud = ring_cloud(scene, still(T_world_sensor));
  Cloud turned = cloud;
  std::swap(turned.rows, turned.columns);
  for (std::size_t place = 0; place < cloud.points.size(); ++place) {
    turned.points[(place % cloud.columns) * cloud.rows + place / cloud.columns] = cloud.points[place];
  }
  const CloudSlice expected = slice(cloud, T_world_sensor);
  expect_same(slice(turned, T_world_sensor).scan, expected.scan);

  Cloud sparse = cloud;
  for (std::size_t place = 0; place < sparse.points.size(); ++place) {
    if (sparse.points[place].z_m < 0.0F && (place % cloud.columns) % 5 != 0) sparse.points[place] = CloudPoint{};
  }
  const CloudSlice of_sparse = slice(sparse, T_world_sensor);
  int free = 0, also_free = 0;
  for (std::size_t i = 0; i < kColumns; ++i) {
    if (expected.scan.beams[i].state != BeamState::kFree) continue;
    ++free;
    also_free += of_sparse.scan.beams[i].state == BeamState::kFree ? 1 : 0;
  }
  EXPECT_GT(free, 500);
  EXPECT_EQ(also_free, free);

  Cloud no_grid = cloud;  // each place has what any other had
  Random random(1);
  for (CloudPoint& point : no_grid.points) {
    const double other = random.uniform(0.0, static_cast<double>(cloud.points.size()));
    std::swap(point, no_grid.points[std::min(static_cast<std::size_t>(other), cloud.points.size() - 1)]);
  }
  for (const Beam& beam : slice(no_grid, T_world_sensor).scan.beams) EXPECT_NE(beam.state, BeamState::kFree);
}

TEST(CloudSlice, OfNothingKnowsNothing) {
  for (Cloud cloud :
       {Cloud{}, Cloud{0, 4, 5, std::vector<CloudPoint>(20)}, Cloud{0, 1, 3, std::vector<CloudPoint>(3)}}) {
    const CloudSlice slice = cloud_slice_test::slice(cloud, Eigen::Isometry3d::Identity());
    EXPECT_EQ(slice.scan.beams.size(), kColumns);
    for (const Beam& beam : slice.scan.beams) EXPECT_EQ(beam.state, BeamState::kInvalid);
  }
  Cloud infinite{0, 1, 2, std::vector<CloudPoint>(2)};
  infinite.points[0] = point_at(0.0, kInfinity, 0.0);
  infinite.points[1].x_m = infinite.points[1].y_m = infinite.points[1].z_m =
      0.0F;  // what some drivers send for nothing
  for (const Beam& beam : slice(infinite, Eigen::Isometry3d::Identity()).scan.beams) {
    EXPECT_EQ(beam.state, BeamState::kInvalid);
  }
}

TEST(CloudSlice, RefusesWhatIsNoCloudOrNoPose) {
  Cloud cloud{0, 2, 3, std::vector<CloudPoint>(5)};
  EXPECT_THROW(slice(cloud, Eigen::Isometry3d::Identity()), std::invalid_argument);
  cloud.points.resize(6);
  Eigen::Isometry3d bad = Eigen::Isometry3d::Identity();
  bad.translation().x() = std::nan("");
  EXPECT_THROW(slice(cloud, bad), std::invalid_argument);
}

TEST(CloudSliceParams, AreRefusedByName) {
  const auto refusal = [](const CloudSliceParams& params) -> std::string {
    try {
      params.validate();
    } catch (const std::invalid_argument& error) {
      return error.what();
    }
    return "accepted";
  };
  CloudSliceParams params;
  EXPECT_EQ(refusal(params), "accepted");
  params.min_height_m = 0.0;
  EXPECT_NE(refusal(params).find("cloud.min_height_m"), std::string::npos);
  params = {};
  params.max_height_m = 0.0;
  EXPECT_NE(refusal(params).find("cloud.max_height_m"), std::string::npos);
  params = {};
  params.min_range_m = 13.0;
  EXPECT_NE(refusal(params).find("cloud.min_range_m"), std::string::npos);
  params = {};
  params.angle_increment_rad = 0.0;
  EXPECT_NE(refusal(params).find("cloud.angle_increment_rad"), std::string::npos);
}

}  // namespace
}  // namespace situation_awareness::cloud_slice_test

// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstdint>
#include <functional>
#include <utility>
#include <vector>

#include "pose/reflector_world.hpp"
#include "support/consistency.hpp"
#include "support/random_gaussian.hpp"

namespace situation_awareness {

inline const std::vector<Eigen::Vector2d> kCenters_m = {
    {4.0, 1.0}, {-2.5, 3.2}, {-1.5, -3.0}, {3.0, -2.8}, {-4.3, -0.6}};

/// The first reflectors of the room, each somewhere about its place if `random` is given.
inline ReflectorMap map_of(std::size_t reflectors, Random* random = nullptr) {
  ReflectorMap map;
  for (std::size_t i = 0; i < reflectors; ++i) {
    Eigen::Vector2d center_m = kCenters_m[i];
    if (random != nullptr) center_m += Eigen::Vector2d(random->uniform(-0.5, 0.5), random->uniform(-0.5, 0.5));
    map.reflectors.push_back({center_m, 0.05});
  }
  return map;
}

/// A scanner that sees all round.
inline ReflectorWorld room_with(const ReflectorMap& map) {
  ReflectorWorld world;
  world.add_room({-5.5, -4.5}, {5.5, 4.5});
  world.add(map);
  world.angle_min_rad = -kPi;
  world.beams = 720;
  return world;
}

/// A robot that is localised while it drives.
struct Drive {
  Drive(const ReflectorMap& map, ReflectorWorld around, std::uint64_t seed, ReflectorLocalizationParams params = {})
      : world(std::move(around)), random(seed), wheels(world.path, seed + 1), localization(map, params) {}

  double time_s() const { return 0.1 + period_s * scans; }
  Pose2 truth() const { return world.path(time_s()); }
  Pose2 truth_at_scan() const { return world.path(stamp_s); }

  void guess(double sigma_m = 0.12, double sigma_rad = 0.07) {
    Pose2 T = truth();
    T.translation_m += sigma_m * normal_vector<2>(random);
    T.yaw_rad += sigma_rad * random.normal();
    localization.initial_pose(nanoseconds(time_s()), T, sigma_m, sigma_rad);
  }

  const ReflectorUpdate& scan() {
    while (wheels.next_time_s() < time_s() + 0.045) {
      auto [stamp_ns, T_odom_base] = wheels.next();
      if (adjust_odometry) T_odom_base = adjust_odometry(T_odom_base);
      localization.add_odometry(stamp_ns, T_odom_base);
    }
    Points points = world.points(time_s(), random);
    if (!use_sweep) points.time_increment_s = 0.0;
    sightings = detect_reflectors(points, {}, std::move(sightings));
    const ReflectorUpdate& update = localization.update(sightings, world.T_base_lidar);
    stamp_s = time_s();
    ++scans;
    return update;
  }

  Eigen::Vector3d error() const {
    return Manifold<Pose2>::local_coordinates(localization.pose().T_world_base.x, world.path(stamp_s));
  }
  double squared_error() const { return nees(localization.pose().T_world_base, world.path(stamp_s)); }

  ReflectorWorld world;
  Random random;
  DriftingWheels wheels;
  ReflectorLocalization localization;
  ReflectorSightings sightings;
  std::function<Pose2(const Pose2&)> adjust_odometry;
  bool use_sweep = true;
  double period_s = 0.04;
  int scans = 0;
  double stamp_s = 0.0;
};

}  // namespace situation_awareness

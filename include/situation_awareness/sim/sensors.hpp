// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include <Eigen/Geometry>

#include "situation_awareness/sim/gnss.hpp"
#include "situation_awareness/sim/imu.hpp"
#include "situation_awareness/sim/label_camera.hpp"
#include "situation_awareness/sim/ring_scanner.hpp"
#include "situation_awareness/sim/scanner.hpp"
#include "situation_awareness/sim/wheel_odometry.hpp"
#include "situation_awareness/sim/world.hpp"

namespace situation_awareness {

/// A sensor of a world's file.
template <class Params>
struct MountedSensor {
  std::string name;
  Eigen::Isometry3d T_robot_sensor = Eigen::Isometry3d::Identity();
  Params params;
};

/// The sensors of a world's file, by kind, each in the order of the file.
struct WorldSensors {
  std::vector<MountedSensor<SimulatedScannerParams>> scanners;
  std::vector<MountedSensor<SimulatedRingScannerParams>> ring_scanners;
  std::vector<MountedSensor<SimulatedImuParams>> imus;
  std::vector<MountedSensor<SimulatedGnssParams>> gnss_receivers;
  std::vector<MountedSensor<SimulatedOdometryParams>> odometries;
  std::vector<MountedSensor<SimulatedLabelCameraParams>> label_cameras;
};

/// Reads the sensors of the file: the kind, then names of the kind's parameters, each followed by its value,
///
///     scanner beams 541 angle_increment_rad 0.00872665 range_sigma_m 0.012
///
/// Others have their defaults, or of a scanner with `preset NAME` those of scanner_presets.hpp; a site `lidar` without
/// a text is a scanner with all defaults. Throws std::runtime_error naming the file, the sensor and its error.
WorldSensors sensors_of(const World& world);

/// The scanner at the site `lidar` of a world, which has the simulation's own seed. Throws as sensors_of, and
/// std::runtime_error naming the file if that site is no scanner.
SimulatedScanner lidar_of(World& world, std::uint64_t seed);

/// The seed of a sensor's noise, derived from its name, so that sensors do not affect each other's noise.
std::uint64_t seed_of_sensor(std::uint64_t seed, const std::string& name);

}  // namespace situation_awareness

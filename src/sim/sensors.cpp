// SPDX-License-Identifier: BSD-3-Clause
#include "situation_awareness/sim/sensors.hpp"

#include <algorithm>
#include <filesystem>
#include <optional>
#include <sstream>
#include <stdexcept>
#include <utility>

#include "named_values.hpp"
#include "seeds.hpp"
#include "situation_awareness/sim/scanner_presets.hpp"

namespace situation_awareness {
namespace {

/// `params` has the values that the text omits.
template <class Params>
MountedSensor<Params> sensor_at(const SensorMount& mount, NamedValues values, Params params = {}) {
  Params::fields(params, values);
  values.check_all_used();
  params.validate();
  return {mount.name, mount.T_robot_sensor, params};
}

/// The scanner of which the text names the preset; without one the default. Names are of folder `scanners` beside the
/// world's folder, paths relative to the world's folder.
SimulatedScannerParams preset_of(NamedValues& values, const std::string& world_path) {
  const std::optional<std::string> preset = values.take("preset");
  if (!preset) return {};
  const std::filesystem::path folder = std::filesystem::path(world_path).parent_path();
  try {
    return load_scanner_preset((folder / scanner_preset_file(*preset, "../scanners")).string());
  } catch (const std::invalid_argument& error) {
    throw std::invalid_argument("has a preset that cannot be used: " + std::string(error.what()));
  }
}

void add_sensor(const SensorMount& mount, const std::string& world_path, WorldSensors& sensors) {
  std::istringstream words(mount.text);
  std::string kind = "scanner";
  if (!(words >> kind) && mount.name != "lidar") throw std::invalid_argument("is empty");
  if (kind == "scanner") {
    NamedValues values(words);
    const SimulatedScannerParams preset = preset_of(values, world_path);
    sensors.scanners.push_back(sensor_at(mount, std::move(values), preset));
  } else if (kind == "ring_scanner") {
    sensors.ring_scanners.push_back(sensor_at<SimulatedRingScannerParams>(mount, NamedValues(words)));
  } else if (kind == "imu") {
    sensors.imus.push_back(sensor_at<SimulatedImuParams>(mount, NamedValues(words)));
  } else if (kind == "gnss") {
    sensors.gnss_receivers.push_back(sensor_at<SimulatedGnssParams>(mount, NamedValues(words)));
  } else if (kind == "odometry") {
    sensors.odometries.push_back(sensor_at<SimulatedOdometryParams>(mount, NamedValues(words)));
  } else if (kind == "label_camera") {
    sensors.label_cameras.push_back(sensor_at<SimulatedLabelCameraParams>(mount, NamedValues(words)));
  } else {
    throw std::invalid_argument("starts with '" + kind +
                                "' instead of scanner, ring_scanner, imu, gnss, odometry or label_camera");
  }
}

}  // namespace

WorldSensors sensors_of(const World& world) {
  WorldSensors sensors;
  for (const SensorMount& mount : world.mounts()) {
    try {
      add_sensor(mount, world.path(), sensors);
    } catch (const std::invalid_argument& error) {
      throw std::runtime_error(world.path() + ": the sensor '" + mount.name + "' " + error.what());
    }
  }
  return sensors;
}

SimulatedScanner lidar_of(World& world, std::uint64_t seed) {
  const WorldSensors sensors = sensors_of(world);
  const auto lidar = std::find_if(sensors.scanners.begin(), sensors.scanners.end(),
                                  [](const auto& scanner) { return scanner.name == "lidar"; });
  if (lidar == sensors.scanners.end()) throw std::runtime_error(world.path() + ": the site 'lidar' is no scanner");
  return {world, lidar->T_robot_sensor, lidar->params, seed};
}

std::uint64_t seed_of_sensor(std::uint64_t seed, const std::string& name) {
  std::uint64_t hash = 0xCBF29CE484222325U;  // FNV-1a, 64 bits
  for (const char c : name) hash = (hash ^ static_cast<unsigned char>(c)) * 0x100000001B3U;
  return seed_of_scan(seed ^ hash, 0);
}

}  // namespace situation_awareness

// SPDX-License-Identifier: BSD-3-Clause
#include "situation_awareness/sim/sensors.hpp"

#include <charconv>
#include <cmath>
#include <map>
#include <sstream>
#include <stdexcept>
#include <type_traits>

#include "seeds.hpp"

namespace situation_awareness {
namespace {

/// The numbers of a text, each after its name, as a visitor of params that assigns them to the fields.
class NamedNumbers {
 public:
  explicit NamedNumbers(std::istream& words) {
    for (std::string name, value; words >> name;) {
      if (!(words >> value)) throw std::invalid_argument("has '" + name + "' without a number");
      double number = 0.0;
      const auto [end, error] = std::from_chars(value.data(), value.data() + value.size(), number);
      if (error != std::errc() || end != value.data() + value.size() || !std::isfinite(number)) {
        throw std::invalid_argument("has '" + value + "' where the number of '" + name + "' should be");
      }
      if (!numbers_.emplace(name, number).second) throw std::invalid_argument("has '" + name + "' twice");
    }
  }

  template <class Value>
  void operator()(const char* name, Value& value, Bounds /*bounds*/, const char* /*unit*/, const char* /*doc*/) {
    const auto number = numbers_.find(name);
    if (number == numbers_.end()) return;
    if (std::is_integral_v<Value> &&
        !(number->second == std::floor(number->second) && std::abs(number->second) < 1e9)) {
      throw std::invalid_argument("needs a whole number after '" + number->first + "'");
    }
    value = static_cast<Value>(number->second);
    numbers_.erase(number);
  }

  void check_all_used() const {
    if (!numbers_.empty()) throw std::invalid_argument("has '" + numbers_.begin()->first + "', which it does not know");
  }

 private:
  std::map<std::string, double> numbers_;
};

template <class Params>
MountedSensor<Params> sensor_at(const SensorMount& mount, std::istream& words) {
  MountedSensor<Params> sensor{mount.name, mount.T_robot_sensor, {}};
  NamedNumbers numbers(words);
  Params::fields(sensor.params, numbers);
  numbers.check_all_used();
  sensor.params.validate();
  return sensor;
}

void add_sensor(const SensorMount& mount, WorldSensors& sensors) {
  std::istringstream words(mount.text);
  std::string kind = "scanner";
  if (!(words >> kind) && mount.name != "lidar") throw std::invalid_argument("is empty");
  if (kind == "scanner") {
    sensors.scanners.push_back(sensor_at<SimulatedScannerParams>(mount, words));
  } else if (kind == "ring_scanner") {
    sensors.ring_scanners.push_back(sensor_at<SimulatedRingScannerParams>(mount, words));
  } else if (kind == "imu") {
    sensors.imus.push_back(sensor_at<SimulatedImuParams>(mount, words));
  } else if (kind == "gnss") {
    sensors.gnss_receivers.push_back(sensor_at<SimulatedGnssParams>(mount, words));
  } else if (kind == "odometry") {
    sensors.odometries.push_back(sensor_at<SimulatedOdometryParams>(mount, words));
  } else if (kind == "label_camera") {
    sensors.label_cameras.push_back(sensor_at<SimulatedLabelCameraParams>(mount, words));
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
      add_sensor(mount, sensors);
    } catch (const std::invalid_argument& error) {
      throw std::runtime_error(world.path() + ": the sensor '" + mount.name + "' " + error.what());
    }
  }
  return sensors;
}

std::uint64_t seed_of_sensor(std::uint64_t seed, const std::string& name) {
  std::uint64_t hash = 0xCBF29CE484222325U;  // FNV-1a, 64 bits
  for (const char c : name) hash = (hash ^ static_cast<unsigned char>(c)) * 0x100000001B3U;
  return seed_of_scan(seed ^ hash, 0);
}

}  // namespace situation_awareness

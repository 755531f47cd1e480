// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstdint>
#include <set>
#include <stdexcept>
#include <string>

#include "situation_awareness/ros/convert/motion_sensors.hpp"
#include "situation_awareness/sim/sensors.hpp"
#include "situation_awareness/sim/world.hpp"

namespace situation_awareness {

/// Topics and frames of several sensors: the first that asks for a name gets it, others get it below their own.
class SensorNames {
 public:
  std::string of(const std::string& sensor, const std::string& name) {
    return taken_.insert(name).second ? name : sensor + "/" + name;
  }

 private:
  std::set<std::string> taken_;
};

/// Makes the IMUs, GNSS receivers and wheel odometries that the world's file asks for: `add(mounted, sensor, topic,
/// to_msg)` for each, where `to_msg` makes the message of a sample; their frames are the sensors' names behind
/// `frame_prefix`. `seed` is that of the simulation. Throws std::runtime_error where a receiver has no world's origin.
template <class Add>
void add_motion_sensors(const World& world, const WorldSensors& sensors, std::uint64_t seed,
                        const std::string& frame_prefix, SensorNames& names, const Add& add) {
  for (const auto& imu : sensors.imus) {
    add(imu, SimulatedImu(world, imu.T_robot_sensor, imu.params, seed_of_sensor(seed, imu.name)),
        names.of(imu.name, "imu"), [params = imu.params, frame = frame_prefix + imu.name](const ImuSample& sample) {
          return imu_to_msg(sample, params, frame);
        });
  }
  for (const auto& gnss : sensors.gnss_receivers) {
    if (!world.origin()) {
      throw std::runtime_error(world.path() + ": the sensor '" + gnss.name +
                               "' needs the numeric 'world_origin': latitude and longitude in deg, altitude in m");
    }
    add(gnss, SimulatedGnss(world, gnss.T_robot_sensor, gnss.params, seed_of_sensor(seed, gnss.name)),
        names.of(gnss.name, "fix"), [origin = *world.origin(), frame = frame_prefix + gnss.name](const GnssFix& fix) {
          return fix_to_msg(fix, origin, frame);
        });
  }
  for (const auto& odometry : sensors.odometries) {
    add(odometry,
        SimulatedOdometry(world, odometry.T_robot_sensor, odometry.params, seed_of_sensor(seed, odometry.name)),
        names.of(odometry.name, "wheel_odometry"),
        [odom = frame_prefix + names.of(odometry.name, "odom"), base = frame_prefix + odometry.name](
            const OdometrySample& sample) { return odometry_to_msg(sample, odom, base); });
  }
}

}  // namespace situation_awareness

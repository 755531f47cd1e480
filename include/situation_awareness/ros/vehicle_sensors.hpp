// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstdint>
#include <memory>
#include <string>
#include <type_traits>
#include <utility>
#include <vector>

#include <geometry_msgs/TransformStamped.h>
#include <ros/node_handle.h>
#include <ros/publisher.h>
#include <sensor_msgs/Imu.h>

#include "situation_awareness/ros/convert/poses.hpp"
#include "situation_awareness/ros/motion_sensors.hpp"
#include "situation_awareness/ros/simulation.hpp"
#include "situation_awareness/sim/schedule.hpp"
#include "situation_awareness/sim/sensors.hpp"
#include "situation_awareness/sim/world.hpp"

namespace situation_awareness {

/// Publishes what the IMUs and receivers of a vehicle measure, when it is there: a sample of an IMU is the mean over
/// its period, in whose middle its stamp is; a fix comes `fix_delay_s` late. Adds where they are on the base to
/// `mounts`. Returns the publisher of the last IMU. `world` and `schedule` must outlive the calls of the schedule.
inline ros::Publisher add_vehicle_sensors(ros::NodeHandle& node, const World& world, std::uint64_t seed,
                                          double fix_delay_s, const std::string& base_frame, Schedule& schedule,
                                          std::vector<geometry_msgs::TransformStamped>& mounts) {
  SensorNames names;
  ros::Publisher imu;
  add_motion_sensors(
      world, sensors_of(world), seed, "", names,
      [&](const auto& mounted, auto sensor, const std::string& topic, const auto& to_msg) {
        using Message = decltype(to_msg(sensor.next()));
        constexpr bool kIsImu = std::is_same_v<Message, sensor_msgs::Imu>;
        const double later_s = kIsImu ? 0.5 / mounted.params.rate_hz : fix_delay_s;
        mounts.push_back(transform_to_msg(mounted.T_robot_sensor, kSimulationStart_ns, base_frame, mounted.name));
        const ros::Publisher publisher = node.advertise<Message>(topic, 1000);
        if (kIsImu) imu = publisher;
        const auto shared = std::make_shared<decltype(sensor)>(std::move(sensor));
        schedule.add([shared, later_s] { return shared->next_time_s() + later_s; },
                     [shared, publisher, to_msg] {
                       auto sample = shared->next();
                       sample.stamp_ns += kSimulationStart_ns;
                       publisher.publish(to_msg(sample));
                     });
      });
  return imu;
}

}  // namespace situation_awareness

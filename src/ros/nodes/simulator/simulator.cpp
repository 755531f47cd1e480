// SPDX-License-Identifier: BSD-3-Clause
// A simulated world in place of a robot: /clock, measurements of the sensors of the world's file, and the truth for
// evaluation and rviz. Its robot is on a path, or is led as a vehicle on wheels, on wings or as a multirotor.
#include <memory>
#include <stdexcept>
#include <string>

#include <ros/ros.h>

#include "situation_awareness/ros/params/param_reader.hpp"
#include "situation_awareness/ros/simulation.hpp"

#include "sensors.hpp"
#include "simulation.hpp"
#include "vehicles.hpp"

namespace situation_awareness {
namespace {

/// The world's sensors, or with `rings` the one that replaces its scanners.
WorldSensors sensors_with(const World& world, int rings) {
  WorldSensors sensors = sensors_of(world);
  if (rings == 0) return sensors;
  MountedSensor<SimulatedRingScannerParams> scanner{"lidar", world.T_robot_lidar(), {}};
  scanner.params.rings = rings;
  sensors.scanners.clear();
  sensors.ring_scanners = {scanner};
  return sensors;
}

void simulate(ros::NodeHandle& node, const ros::NodeHandle& private_node) {
  const auto name = private_node.param<std::string>("world", kDefaultWorld);
  World world(world_file(name));
  const VehicleKind kind = kind_of(world);
  const auto params = ParamReader(private_node).read(refuse_for_robot(name, kind), SimulatorParams(kind));
  Simulation simulation(node, params, world, sensors_with(world, params.rings));
  const std::unique_ptr<SimulatedVehicle> vehicle = make_vehicle(simulation);
  const SensorTopics topics = add_sensors(simulation, *vehicle);
  simulation.clock.wait_for([&] { return vehicle->is_heard(topics); }, 30.0);
  simulation.clock.wait_for([&] { return vehicle->has_leader(); }, params.is_led() ? 30.0 : 5.0);
  simulation.clock.start();
  vehicle->start();
  double now_s = 0.0;
  while (ros::ok()) {
    const double due_s = simulation.schedule.next_time_s();
    if (params.duration_s > 0.0 && due_s > params.duration_s) break;
    if (due_s > now_s) {
      now_s = due_s;
      simulation.clock.advance(now_s);
      ros::spinOnce();
      vehicle->advance(now_s);
    }
    simulation.schedule.step();
  }
  if (ros::ok()) ros::WallDuration(0.5).sleep();  // the last messages are still in transit
}

}  // namespace
}  // namespace situation_awareness

int main(int argc, char** argv) {
  ros::init(argc, argv, "simulator");
  ros::NodeHandle node;  // outlives the handler below, which needs it for the log
  const ros::NodeHandle private_node("~");
  try {
    situation_awareness::simulate(node, private_node);
  } catch (const std::exception& error) {
    ROS_FATAL_STREAM(ros::this_node::getName() << " does not start: " << error.what());
    return 1;
  }
  return 0;
}

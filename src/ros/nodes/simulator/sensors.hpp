// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include "simulation.hpp"
#include "vehicles.hpp"

namespace situation_awareness {

/// Lets the schedule publish what the sensors of the world's file measure, and publishes where they are on the robot.
/// Of a robot on a path a sample is there at the beginning of its period; of one that is led, whose motion is known
/// until now, when the scan, or the IMU's period, is over, and a fix comes `fix_delay_s` late. The first sensor of a
/// kind has the plain topic, others one below their own name. `simulation` and `vehicle` must outlive the schedule's
/// calls.
SensorTopics add_sensors(Simulation& simulation, SimulatedVehicle& vehicle);

}  // namespace situation_awareness

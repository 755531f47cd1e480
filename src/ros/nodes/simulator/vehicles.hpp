// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstddef>
#include <cstdint>
#include <memory>
#include <string>
#include <vector>

#include <geometry_msgs/TransformStamped.h>
#include <ros/publisher.h>
#include <ros/subscriber.h>
#include <Eigen/Geometry>

#include "situation_awareness/sim/truth.hpp"

#include "simulation.hpp"

namespace situation_awareness {

/// Topics of the sensors, by whose subscribers a vehicle knows that it can start.
struct SensorTopics {
  ros::Publisher scan;                 ///< of the first scanner, or ring scanner
  ros::Publisher imu;                  ///< of the last one
  std::vector<ros::Publisher> images;  ///< labels and pictures
};

/// What is true of a scan that was published.
struct ScanTruth {
  std::int64_t stamp_ns;             ///< on the simulation's clock
  const std::vector<TrueHit>& hits;  ///< rows of `columns`
  std::size_t columns;
  const Eigen::Isometry3d& T_world_sensor;  ///< at the stamp
};

/// How the robot of a world moves, by whom it is led, and what is published of it in truth.
class SimulatedVehicle {
 public:
  /// `simulation` must outlive this, which adds to its schedule what it does at fixed rates.
  explicit SimulatedVehicle(Simulation& simulation)
      : simulation_(simulation), params_(simulation.params), world_(simulation.world) {}
  virtual ~SimulatedVehicle() = default;

  /// Whether those listen for whom it starts.
  virtual bool is_heard(const SensorTopics& topics) const { return topics.scan.getNumSubscribers() > 0; }

  /// Whether those are there that lead it, or nobody does; for a robot on a path the map.
  bool has_leader() const { return !leader_ || leader_.getNumPublishers() > 0; }

  /// Time 0 has come.
  virtual void start() {}

  /// Moves on to that time.
  virtual void advance(double /*time_s*/) {}

  /// Whether its scanners are on when a scan begins.
  virtual bool scans(double /*time_s*/) const { return true; }

  /// The first scanner's scan was published.
  virtual void scanned(const ScanTruth& /*truth*/) {}

 protected:
  std::int64_t stamp_ns(double time_s) const { return simulation_.clock.stamp_ns(time_s); }

  void need_scanner() const;

  geometry_msgs::TransformStamped true_transform(double time_s) const;

  template <class Message>
  ros::Publisher advertise(const std::string& topic, std::uint32_t queue, bool latch = false) {
    return simulation_.node.advertise<Message>(topic, queue, latch);
  }

  template <class Message, class Take>
  void follow(const std::string& topic, const Take& take) {
    leader_ = simulation_.node.subscribe<Message>(
        topic, 10, [take](const boost::shared_ptr<const Message>& message) { take(*message); });
  }

  Simulation& simulation_;
  const SimulatorParams& params_;
  World& world_;
  ros::Subscriber leader_;
};

/// The vehicle of the simulation's world. Throws std::runtime_error naming the file that lacks what it needs.
std::unique_ptr<SimulatedVehicle> make_vehicle(Simulation& simulation);

}  // namespace situation_awareness

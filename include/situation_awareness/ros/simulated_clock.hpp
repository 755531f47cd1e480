// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <ros/node_handle.h>
#include <ros/publisher.h>
#include <ros/time.h>
#include <rosgraph_msgs/Clock.h>

#include "situation_awareness/common/time.hpp"
#include "situation_awareness/ros/convert/time.hpp"
#include "situation_awareness/ros/simulation.hpp"

namespace situation_awareness {

/// The clock of a simulated vehicle: /clock, at so many simulated seconds per second.
class SimulatedClock {
 public:
  SimulatedClock(ros::NodeHandle& node, double rate)
      : rate_(rate), publisher_(node.advertise<rosgraph_msgs::Clock>("/clock", 100)) {}

  void publish(double time_s) {
    rosgraph_msgs::Clock msg;
    msg.clock = to_ros_time(kSimulationStart_ns + nanoseconds(time_s));
    publisher_.publish(msg);
  }

  /// The simulation's time 0 is now.
  void start() {
    start_ = ros::WallTime::now();
    publish(0.0);
  }

  /// Sleeps until that time of the simulation, and publishes it. If far behind, it continues from now as if started
  /// later: catching up would be too fast for those that steer.
  void advance(double time_s) {
    const ros::WallDuration elapsed(time_s / rate_), far_behind(0.1);
    const ros::WallDuration left = start_ + elapsed - ros::WallTime::now();
    if (left > ros::WallDuration(0.0)) left.sleep();
    if (left < -far_behind) start_ = ros::WallTime::now() - elapsed;
    publish(time_s);
  }

  /// Publishes the time 0 until `there` or until the timeout, in wall time.
  template <class Condition>
  void wait_for(const Condition& there, double timeout_s) {
    const ros::WallTime end = ros::WallTime::now() + ros::WallDuration(timeout_s);
    while (ros::ok() && !there() && ros::WallTime::now() < end) {
      publish(0.0);
      ros::WallDuration(0.05).sleep();
    }
  }

 private:
  double rate_;
  ros::Publisher publisher_;
  ros::WallTime start_;
};

}  // namespace situation_awareness

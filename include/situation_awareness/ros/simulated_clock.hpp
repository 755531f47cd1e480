// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstdint>

#include <ros/node_handle.h>
#include <ros/publisher.h>
#include <ros/time.h>
#include <rosgraph_msgs/Clock.h>

#include "situation_awareness/common/time.hpp"
#include "situation_awareness/ros/convert/time.hpp"
#include "situation_awareness/ros/simulation.hpp"

namespace situation_awareness {

/// The clock of a simulation, at so many simulated seconds per second (`rate`; 0: as fast as it goes): /clock, or that
/// of the wall.
class SimulatedClock {
 public:
  /// `far_behind_s`: when it is later than that, it continues from now as if started later; catching up would be too
  /// fast for those that follow.
  SimulatedClock(ros::NodeHandle& node, double rate, bool is_wall, double far_behind_s)
      : rate_(rate), is_wall_(is_wall), far_behind_(far_behind_s) {
    if (!is_wall) publisher_ = node.advertise<rosgraph_msgs::Clock>("/clock", 100);
  }

  /// The stamp of a time of the simulation.
  std::int64_t stamp_ns(double time_s) const { return start_ns_ + nanoseconds(time_s); }

  /// The stamp of its time 0.
  std::int64_t start_ns() const { return start_ns_; }

  /// The simulation's time 0 is now.
  void start() {
    start_ = ros::WallTime::now();
    if (is_wall_) start_ns_ = static_cast<std::int64_t>(start_.toNSec());
    publish(0.0);
  }

  /// Sleeps until that time of the simulation, and publishes it.
  void advance(double time_s) {
    if (rate_ > 0.0) {
      const ros::WallDuration elapsed(time_s / rate_);
      const ros::WallDuration left = start_ + elapsed - ros::WallTime::now();
      if (left > ros::WallDuration(0.0)) left.sleep();
      if (left < -far_behind_) start_ = ros::WallTime::now() - elapsed;
    }
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
  void publish(double time_s) {
    if (is_wall_) return;
    rosgraph_msgs::Clock msg;
    msg.clock = to_ros_time(stamp_ns(time_s));
    publisher_.publish(msg);
  }

  double rate_;
  bool is_wall_;
  ros::WallDuration far_behind_;
  ros::Publisher publisher_;
  ros::WallTime start_;
  std::int64_t start_ns_ = kSimulationStart_ns;
};

}  // namespace situation_awareness

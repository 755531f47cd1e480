// SPDX-License-Identifier: BSD-3-Clause
// A simulated world in place of a robot: /clock, TF, odometry and scan, and the truth that a map is judged by.
#include <algorithm>
#include <atomic>
#include <optional>

#include <nav_msgs/Odometry.h>
#include <ros/ros.h>
#include <rosgraph_msgs/Clock.h>
#include <sensor_msgs/LaserScan.h>
#include <tf2_ros/static_transform_broadcaster.h>
#include <tf2_ros/transform_broadcaster.h>

#include "situation_awareness/common/time.hpp"
#include "situation_awareness/ros/convert/objects.hpp"
#include "situation_awareness/ros/convert/poses.hpp"
#include "situation_awareness/ros/convert/scan.hpp"
#include "situation_awareness/ros/convert/time.hpp"
#include "situation_awareness/ros/markers/object_markers.hpp"
#include "situation_awareness/ros/params/param_reader.hpp"
#include "situation_awareness/ros/simulation.hpp"
#include "situation_awareness/sim/scan_simulation.hpp"

namespace situation_awareness {
namespace {

constexpr int kPosesPerScan = 5;   ///< TF and /clock come this much faster than scans
constexpr int kMaxScansAhead = 3;  ///< of the map, when running as fast as it goes

struct SimulatorParams {
  std::string world;
  bool clock = true;  ///< publish /clock; false: stamps of the wall clock
  double rate = 1.0;  ///< simulated seconds per second; 0: as fast as the map follows
  int seed = 1;
  double duration_s = 0.0;  ///< 0: for ever
  std::string world_frame, robot_frame, lidar_frame;
};

SimulatorParams read_simulator_params(ParamReader reader) {
  SimulatorParams params;
  params.world = reader.take_text("world", "demo");
  params.clock = reader.take_flag("clock", params.clock);
  params.rate = reader.take_number("rate", params.rate, Bounds{0.0, 100.0}, "");
  params.seed = reader.take_integer("seed", params.seed, Bounds{0, 2147483647}, "");
  params.duration_s = reader.take_number("duration_s", params.duration_s, Bounds{0.0, 1e6}, "s");
  params.world_frame = reader.take_text("world_frame", "world");
  params.robot_frame = reader.take_text("robot_frame", "robot");
  params.lidar_frame = reader.take_text("lidar_frame", "lidar");
  reader.refuse_rest();
  if (!params.clock && (params.rate != 1.0 || !ros::Time::isSystemTime())) {
    throw std::invalid_argument("clock = false is the wall clock: it needs rate = 1 and /use_sim_time = false");
  }
  return params;
}

class Simulator {
 public:
  Simulator(ros::NodeHandle node, const SimulatorParams& params)
      : params_(params), world_(world_file(params.world), lidar_, static_cast<std::uint64_t>(params.seed)) {
    if (params.clock) clock_ = node.advertise<rosgraph_msgs::Clock>("/clock", 100);
    odometry_ = node.advertise<nav_msgs::Odometry>("odometry", 100);
    scan_ = node.advertise<sensor_msgs::LaserScan>("scan", 50);
    truth_ = node.advertise<EllipseMap>("truth", 50);
    markers_ = node.advertise<visualization_msgs::MarkerArray>("truth_markers", 10);
    map_ = node.subscribe<EllipseMap>("objects", 50, [this](const EllipseMapConstPtr& msg) {
      mapped_ns_ = std::max(mapped_ns_.load(), to_nanoseconds(msg->header.stamp));
    });
    static_tf_.sendTransform(
        transform_to_msg(world_.T_robot_lidar(), start_ns_, params_.robot_frame, params_.lidar_frame));
  }

  void run() {
    const std::int64_t period_ns = nanoseconds(1.0 / lidar_.rate_hz);
    // The first scan waits for someone to see it, and a little for the map: they start slower than a simulation.
    wait_for([this] { return scan_.getNumSubscribers() > 0; }, 30.0);
    wait_for([this] { return map_.getNumPublishers() > 0; }, 5.0);
    ros::WallTime start = ros::WallTime::now();
    if (!params_.clock) start_ns_ = static_cast<std::int64_t>(start.toNSec());
    std::int64_t time_ns = 0;
    while (ros::ok() && (params_.duration_s <= 0.0 || seconds_between(0, time_ns) <= params_.duration_s)) {
      const SimulatedScan simulated = world_.next();
      time_ns = simulated.scan.stamp_ns;
      publish(simulated);
      for (int i = 1; i <= kPosesPerScan && ros::ok(); ++i) {
        const std::int64_t pose_time_ns = time_ns + i * period_ns / kPosesPerScan;
        if (params_.rate > 0.0) start = pace(start, seconds_between(0, pose_time_ns) / params_.rate);
        publish_clock(start_ns_ + pose_time_ns);
        // The pose at the next scan's stamp goes out with that scan.
        if (i < kPosesPerScan) publish_pose(world_.robot_at(seconds_between(0, pose_time_ns)), pose_time_ns);
      }
      if (params_.rate <= 0.0) wait_for_map(start_ns_ + time_ns - kMaxScansAhead * period_ns);
    }
  }

 private:
  /// Sleep until `elapsed_s` after `start`. A machine that is far behind goes on from now, as if it had started later:
  /// to catch up would flood the map.
  static ros::WallTime pace(const ros::WallTime& start, double elapsed_s) {
    const ros::WallDuration elapsed(elapsed_s), far_behind(0.25);
    const ros::WallDuration left = start + elapsed - ros::WallTime::now();
    if (left > ros::WallDuration(0.0)) left.sleep();
    return left < -far_behind ? ros::WallTime::now() - elapsed : start;
  }

  /// Keep the clock alive until `there` or until patience ends.
  template <class Condition>
  void wait_for(const Condition& there, double patience_s) {
    const ros::WallTime end = ros::WallTime::now() + ros::WallDuration(patience_s);
    while (ros::ok() && !there() && ros::WallTime::now() < end) {
      publish_clock(start_ns_);
      ros::WallDuration(0.05).sleep();
    }
  }

  /// As fast as it goes means as fast as the map follows: without a wait every queue would overflow.
  void wait_for_map(std::int64_t stamp_ns) const {
    if (map_.getNumPublishers() == 0) {
      ros::WallDuration(0.002).sleep();
      return;
    }
    const ros::WallTime patience = ros::WallTime::now() + ros::WallDuration(0.2);
    while (ros::ok() && mapped_ns_ < stamp_ns && ros::WallTime::now() < patience) ros::WallDuration(0.0005).sleep();
  }

  void publish_clock(std::int64_t stamp_ns) {
    if (!params_.clock) return;
    rosgraph_msgs::Clock msg;
    msg.clock = to_ros_time(stamp_ns);
    clock_.publish(msg);
  }

  void publish_pose(const RobotState& robot, std::int64_t time_ns) {
    const auto tf =
        transform_to_msg(robot.T_world_robot, start_ns_ + time_ns, params_.world_frame, params_.robot_frame);
    tf_.sendTransform(tf);
    nav_msgs::Odometry msg;
    msg.header = tf.header;
    msg.child_frame_id = params_.robot_frame;
    msg.pose.pose.position.x = tf.transform.translation.x;
    msg.pose.pose.position.y = tf.transform.translation.y;
    msg.pose.pose.position.z = tf.transform.translation.z;
    msg.pose.pose.orientation = tf.transform.rotation;
    const Eigen::Vector3d velocity_robot_m_s =  // nav_msgs: the twist is in the child's frame
        robot.T_world_robot.linear().transpose() * robot.velocity_world_m_s;
    msg.twist.twist.linear.x = velocity_robot_m_s.x();
    msg.twist.twist.linear.y = velocity_robot_m_s.y();
    msg.twist.twist.linear.z = velocity_robot_m_s.z();
    msg.twist.twist.angular.x = robot.angular_velocity_robot_rad_s.x();
    msg.twist.twist.angular.y = robot.angular_velocity_robot_rad_s.y();
    msg.twist.twist.angular.z = robot.angular_velocity_robot_rad_s.z();
    odometry_.publish(msg);
  }

  void publish(const SimulatedScan& simulated) {
    publish_clock(start_ns_ + simulated.scan.stamp_ns);
    publish_pose(simulated.robot, simulated.scan.stamp_ns);
    Objects truth = simulated.truth;
    truth.stamp_ns += start_ns_;
    for (Object& object : truth.objects) {
      object.first_seen_ns += start_ns_;
      object.last_seen_ns += start_ns_;
    }
    truth_.publish(objects_to_msg(truth, params_.world_frame, simulated.names));
    if (markers_.getNumSubscribers() > 0) {
      markers_.publish(truth_markers_.update(truth, params_.world_frame, simulated.names));
    }
    Scan scan = simulated.scan;
    scan.stamp_ns += start_ns_;
    scan_.publish(scan_to_msg(scan, params_.lidar_frame, lidar_.range_min_m, lidar_.range_max_m, 1.0 / lidar_.rate_hz));
  }

  SimulatorParams params_;
  std::int64_t start_ns_ = kSimulationStart_ns;  ///< stamp of the first scan
  SimulatedScannerParams lidar_;
  ScanSimulation world_;
  ros::Publisher clock_, odometry_, scan_, truth_, markers_;
  ros::Subscriber map_;
  tf2_ros::TransformBroadcaster tf_;
  tf2_ros::StaticTransformBroadcaster static_tf_;
  ObjectMarkers truth_markers_{MarkerStyle::kTruth};
  std::atomic<std::int64_t> mapped_ns_{0};
};

}  // namespace
}  // namespace situation_awareness

int main(int argc, char** argv) {
  ros::init(argc, argv, "simulator");
  ros::NodeHandle node;  // outlives the handler below: without a node there is no log
  const ros::NodeHandle private_node("~");
  try {
    situation_awareness::Simulator simulator(
        node, situation_awareness::read_simulator_params(situation_awareness::ParamReader(private_node)));
    ros::AsyncSpinner spinner(1);
    spinner.start();
    simulator.run();
    ros::WallDuration(0.5).sleep();  // the last messages are still on their way
  } catch (const std::exception& error) {
    ROS_FATAL_STREAM(ros::this_node::getName() << " does not start: " << error.what());
    return 1;
  }
  return 0;
}

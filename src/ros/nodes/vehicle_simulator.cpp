// SPDX-License-Identifier: BSD-3-Clause
// A simulated vehicle in place of one's own: it is driven by `cmd_vel` from dock to dock through a world that changes
// meanwhile, and publishes /clock, wheel odometry, scans, and the truth for evaluation and rviz.
#include <mutex>
#include <optional>
#include <stdexcept>
#include <string>
#include <utility>
#include <vector>

#include <geometry_msgs/PoseStamped.h>
#include <geometry_msgs/Twist.h>
#include <nav_msgs/Odometry.h>
#include <ros/ros.h>
#include <sensor_msgs/LaserScan.h>
#include <tf2_ros/static_transform_broadcaster.h>
#include <tf2_ros/transform_broadcaster.h>

#include "situation_awareness/Transit.h"
#include "situation_awareness/common/time.hpp"
#include "situation_awareness/ros/convert/motion_sensors.hpp"
#include "situation_awareness/ros/convert/odometry.hpp"
#include "situation_awareness/ros/convert/poses.hpp"
#include "situation_awareness/ros/convert/scan.hpp"
#include "situation_awareness/ros/convert/time.hpp"
#include "situation_awareness/ros/markers/truth_markers.hpp"
#include "situation_awareness/ros/params/param_reader.hpp"
#include "situation_awareness/ros/simulated_clock.hpp"
#include "situation_awareness/ros/simulation.hpp"
#include "situation_awareness/sim/scanner.hpp"
#include "situation_awareness/sim/schedule.hpp"
#include "situation_awareness/sim/sensors.hpp"
#include "situation_awareness/sim/transits.hpp"
#include "situation_awareness/sim/wheel_odometry.hpp"
#include "situation_awareness/sim/world.hpp"

namespace situation_awareness {
namespace {

constexpr double kMarkersPeriod_s = 0.2;

struct VehicleSimulatorParams {
  std::string world = "corridor";
  double rate = 1.0;
  int seed = 1;
  bool true_localization = false;
  std::string world_frame = "map";
  std::string odom_frame = "odom";
  std::string base_frame = "base_link";
  std::string lidar_frame = "laser";
  TransitsParams transits;

  template <class Self, class Visit>
  static void fields(Self& self, Visit&& visit) {
    visit("world", self.world, "name of a world in models/worlds, or a path");
    visit("rate", self.rate, Bounds{0.01, 100.0}, "", "simulated seconds per second");
    visit("seed", self.seed, Bounds{0, 2147483647}, "", "seed of the noise");
    visit("true_localization", self.true_localization,
          "publish the true transform from world_frame to odom_frame, in the place of a localisation");
    visit("world_frame", self.world_frame, "frame of the truth");
    visit("odom_frame", self.odom_frame, "frame of the odometry, parent of the vehicle's in TF");
    visit("base_frame", self.base_frame, "frame of the vehicle");
    visit("lidar_frame", self.lidar_frame, "frame of the scans");
    TransitsParams::fields(self.transits, visit);
  }
};

class VehicleSimulator {
 public:
  VehicleSimulator(const ros::NodeHandle& node, const VehicleSimulatorParams& params)
      : params_(params),
        node_(node),
        clock_(node_, params.rate),
        world_(world_file(params.world)),
        transits_(world_, params.transits),
        scanner_(lidar_of(world_, static_cast<std::uint64_t>(params.seed))),
        odometry_(make_odometry()) {
    odom_ = node_.advertise<nav_msgs::Odometry>("odom", 100);
    scan_ = node_.advertise<sensor_msgs::LaserScan>("scan", 50);
    true_pose_ = node_.advertise<geometry_msgs::PoseStamped>("true_pose", 100);
    transit_ = node_.advertise<Transit>("transit", 10, /*latch=*/true);
    markers_ = node_.advertise<visualization_msgs::MarkerArray>("truth_markers", 10);
    commands_ = node_.subscribe<geometry_msgs::Twist>("cmd_vel", 10, [this](const geometry_msgs::TwistConstPtr& msg) {
      const std::lock_guard<std::mutex> lock(mutex_);
      command_ = *msg;
    });
    static_tf_.sendTransform(
        transform_to_msg(world_.T_robot_lidar(), kSimulationStart_ns, params_.base_frame, params_.lidar_frame));
    schedule_.add([this] { return odometry_.next_time_s(); }, [this] { publish_odometry(); });
    // A scan is there when its last beam has been measured.
    schedule_.add([this] { return scanner_.next_time_s() + scanner_.params().sweep_s; }, [this] { publish_scan(); });
    schedule_.add_every(kMarkersPeriod_s, [this](double time_s) { publish_markers(time_s); });
  }

  void run() {
    // All starts from a stand, when those that steer it are there.
    clock_.wait_for([this] { return scan_.getNumSubscribers() > 0; }, 30.0);
    clock_.wait_for([this] { return commands_.getNumPublishers() > 0; }, 30.0);
    clock_.start();
    publish_transit();
    double now_s = 0.0;
    while (ros::ok()) {
      const double due_s = schedule_.next_time_s();
      if (due_s > now_s) {
        now_s = due_s;
        clock_.advance(now_s);
        drive(now_s);
      }
      schedule_.step();
    }
  }

 private:
  SimulatedOdometry make_odometry() {
    const WorldSensors sensors = sensors_of(world_);
    if (sensors.odometries.size() != 1) {
      throw std::runtime_error(world_.path() + ": a vehicle needs one sensor of the kind odometry");
    }
    const auto& odometry = sensors.odometries.front();
    if (!odometry.T_robot_sensor.isApprox(Eigen::Isometry3d::Identity(), 1e-9)) {
      throw std::runtime_error(world_.path() + ": the odometry '" + odometry.name + "' is not at the robot's origin");
    }
    return {world_, odometry.T_robot_sensor, odometry.params,
            seed_of_sensor(static_cast<std::uint64_t>(params_.seed), odometry.name)};
  }

  void drive(double time_s) {
    std::optional<geometry_msgs::Twist> command;
    {
      const std::lock_guard<std::mutex> lock(mutex_);
      std::swap(command, command_);
    }
    if (command) transits_.command(command->linear.x, command->angular.z);
    const bool was_docked = transits_.docked();
    transits_.advance(time_s);
    if (transits_.docked() != was_docked) publish_transit();
  }

  void publish_odometry() {
    OdometrySample sample = odometry_.next();
    const Eigen::Isometry3d T_world_base = world_.robot_at(seconds_between(0, sample.stamp_ns)).T_world_robot;
    sample.stamp_ns += kSimulationStart_ns;
    const nav_msgs::Odometry msg = odometry_to_msg(sample, params_.odom_frame, params_.base_frame);
    const Eigen::Isometry3d T_odom_base = isometry_in_plane(sample.T_odom_base);
    if (params_.true_localization) {
      tf_.sendTransform(transform_to_msg(T_world_base * T_odom_base.inverse(), sample.stamp_ns, params_.world_frame,
                                         params_.odom_frame));
    }
    tf_.sendTransform(transform_to_msg(T_odom_base, sample.stamp_ns, params_.odom_frame, params_.base_frame));
    odom_.publish(msg);
  }

  void publish_scan() {
    if (transits_.docked() || scanner_.next_time_s() < transits_.begin_s()) return scanner_.skip();
    ScannerSample sample = scanner_.next();
    const Eigen::Isometry3d T_world_base = world_.robot_at(seconds_between(0, sample.scan.stamp_ns)).T_world_robot;
    sample.scan.stamp_ns += kSimulationStart_ns;
    const SimulatedScannerParams& params = scanner_.params();
    scan_.publish(
        scan_to_msg(sample.scan, params_.lidar_frame, params.range_min_m, params.range_max_m, 1.0 / params.rate_hz));
    const auto tf = transform_to_msg(T_world_base, sample.scan.stamp_ns, params_.world_frame, params_.base_frame);
    geometry_msgs::PoseStamped msg;
    msg.header = tf.header;
    msg.pose = pose_of(tf.transform);
    true_pose_.publish(msg);
  }

  /// What stands, at the height of the scanner.
  std::vector<TrueOutline> outlines() const {
    const double height_m = world_.robot_at(world_.vehicle()->time_s()).T_world_robot.translation().z() +
                            world_.T_robot_lidar().translation().z();
    return world_.outlines_at(world_.vehicle()->time_s(), height_m);
  }

  void publish_transit() {
    Transit msg;
    const double time_s = transits_.docked() ? transits_.end_s() : transits_.begin_s();
    msg.header.stamp = to_ros_time(kSimulationStart_ns + nanoseconds(time_s));
    msg.header.frame_id = params_.world_frame;
    msg.number = static_cast<std::uint32_t>(transits_.transit());
    msg.transits = static_cast<std::uint32_t>(params_.transits.transits);
    msg.docked = transits_.docked();
    if (transits_.docked()) msg.duration_s = transits_.end_s() - transits_.begin_s();
    for (const TrueOutline& outline : outlines()) {
      ThingOutline outline_msg;
      outline_msg.thing = outline.thing;
      outline_msg.is_there = outline.is_there;
      outline_msg.can_move = outline.can_move;
      for (const Eigen::Vector2d& p_world : outline.points_world_m) {
        outline_msg.vertices.emplace_back();
        outline_msg.vertices.back().x = p_world.x();
        outline_msg.vertices.back().y = p_world.y();
      }
      msg.outlines.push_back(std::move(outline_msg));
    }
    transit_.publish(msg);
    ROS_INFO_STREAM("transit " << msg.number << " of " << msg.transits << (msg.docked ? " has ended" : " begins"));
  }

  void publish_markers(double time_s) {
    if (markers_.getNumSubscribers() == 0) return;
    markers_.publish(
        truth_markers_.update(outlines(), 0.0, params_.world_frame, kSimulationStart_ns + nanoseconds(time_s)));
  }

  VehicleSimulatorParams params_;
  ros::NodeHandle node_;
  SimulatedClock clock_;
  World world_;
  Transits transits_;
  SimulatedScanner scanner_;
  SimulatedOdometry odometry_;
  Schedule schedule_;
  ros::Publisher odom_, scan_, true_pose_, transit_, markers_;
  ros::Subscriber commands_;
  tf2_ros::TransformBroadcaster tf_;
  tf2_ros::StaticTransformBroadcaster static_tf_;
  TruthMarkers truth_markers_;
  std::mutex mutex_;
  std::optional<geometry_msgs::Twist> command_;  ///< that came since the last step; under the mutex
};

}  // namespace
}  // namespace situation_awareness

int main(int argc, char** argv) {
  ros::init(argc, argv, "vehicle_simulator");
  ros::NodeHandle node;  // outlives the handler below, which needs it for the log
  const ros::NodeHandle private_node("~");
  try {
    situation_awareness::VehicleSimulator simulator(
        node, situation_awareness::ParamReader(private_node)
                  .read<situation_awareness::VehicleSimulatorParams>(situation_awareness::refuse));
    ros::AsyncSpinner spinner(1);
    spinner.start();
    simulator.run();
  } catch (const std::exception& error) {
    ROS_FATAL_STREAM(ros::this_node::getName() << " does not start: " << error.what());
    return 1;
  }
  return 0;
}

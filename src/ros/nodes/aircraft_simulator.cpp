// SPDX-License-Identifier: BSD-3-Clause
// A simulated fixed-wing-like vehicle in place of one's own: it is turned by `cmd_vel`, or flies scripted rounds, and
// publishes /clock, what its IMU, its receiver and its scanner measure, and the truth for evaluation and rviz.
#include <algorithm>
#include <mutex>
#include <optional>
#include <stdexcept>
#include <string>
#include <utility>
#include <vector>

#include <geometry_msgs/PoseStamped.h>
#include <geometry_msgs/Twist.h>
#include <nav_msgs/Path.h>
#include <ros/ros.h>
#include <sensor_msgs/LaserScan.h>
#include <std_msgs/Empty.h>
#include <tf2_ros/static_transform_broadcaster.h>
#include <tf2_ros/transform_broadcaster.h>

#include "situation_awareness/common/time.hpp"
#include "situation_awareness/path/rounds.hpp"
#include "situation_awareness/ros/convert/odometry.hpp"
#include "situation_awareness/ros/convert/poses.hpp"
#include "situation_awareness/ros/convert/scan.hpp"
#include "situation_awareness/ros/convert/time.hpp"
#include "situation_awareness/ros/markers/truth_markers.hpp"
#include "situation_awareness/ros/params/param_reader.hpp"
#include "situation_awareness/ros/simulated_clock.hpp"
#include "situation_awareness/ros/simulation.hpp"
#include "situation_awareness/ros/vehicle_sensors.hpp"
#include "situation_awareness/sim/fixed_wing.hpp"
#include "situation_awareness/sim/scanner.hpp"
#include "situation_awareness/sim/schedule.hpp"
#include "situation_awareness/sim/sensors.hpp"
#include "situation_awareness/sim/world.hpp"

namespace situation_awareness {
namespace {

constexpr double kMarkersPeriod_s = 0.5;
constexpr double kControlPeriod_s = 0.05;  ///< of the scripted flight
constexpr double kTruthPeriod_s = 0.02;
constexpr double kPathStep_m = 0.5;

struct AircraftSimulatorParams {
  std::string world = "towers";
  double rate = 1.0;
  int seed = 1;
  bool scripted = true;
  int rounds = 0;
  double fix_delay_s = 0.1;
  bool true_localization = false;
  std::string world_frame = "world";
  std::string base_frame = "base_link";
  std::string lidar_frame = "laser";
  RoundsParams flight;

  template <class Self, class Visit>
  static void fields(Self& self, Visit&& visit) {
    visit("world", self.world, "name of a world in models/worlds, or a path");
    visit("rate", self.rate, Bounds{0.01, 100.0}, "", "simulated seconds per second");
    visit("seed", self.seed, Bounds{0, 2147483647}, "", "seed of the noise");
    visit("scripted", self.scripted, "fly the rounds of the world's file; false: by cmd_vel");
    visit("rounds", self.rounds, Bounds{0, 1000}, "", "how many of these; 0: all");
    visit("fix_delay_s", self.fix_delay_s, Bounds{0.0, 1.0}, "s", "from the stamp of a fix until it is published");
    visit("true_localization", self.true_localization,
          "publish the true transform from world_frame to base_frame, in the place of a localisation");
    visit("world_frame", self.world_frame, "frame of the truth");
    visit("base_frame", self.base_frame, "frame of the vehicle");
    visit("lidar_frame", self.lidar_frame, "frame of the scans");
    RoundsParams::fields(self.flight, visit);
  }
};

class AircraftSimulator {
 public:
  AircraftSimulator(const ros::NodeHandle& node, const AircraftSimulatorParams& params)
      : params_(params),
        node_(node),
        clock_(node_, params.rate),
        world_(world_file(params.world)),
        aircraft_(aircraft_of(world_)),
        scanner_(lidar_of(world_, static_cast<std::uint64_t>(params.seed))) {
    scan_ = node_.advertise<sensor_msgs::LaserScan>("scan", 50);
    true_pose_ = node_.advertise<geometry_msgs::PoseStamped>("true_pose", 200);
    markers_ = node_.advertise<visualization_msgs::MarkerArray>("truth_markers", 10);
    if (params.scripted) {
      std::vector<Eigen::Vector3d> circles = world_.rounds();
      if (params.rounds > 0) circles.resize(std::min(circles.size(), static_cast<std::size_t>(params.rounds)));
      rounds_.emplace(circles, params.flight, 1.0 / aircraft_.params().radius_m);
      path_ = node_.advertise<nav_msgs::Path>("path", 5, /*latch=*/true);
      done_ = node_.advertise<std_msgs::Empty>("flight_done", 1, /*latch=*/true);
      schedule_.add_every(kControlPeriod_s, [this](double time_s) { steer(time_s); });
    } else {
      commands_ = node_.subscribe<geometry_msgs::Twist>("cmd_vel", 10, [this](const geometry_msgs::TwistConstPtr& msg) {
        const std::lock_guard<std::mutex> lock(mutex_);
        command_ = *msg;
      });
    }
    schedule_.add_every(kTruthPeriod_s, [this](double time_s) { publish_true_pose(time_s); });
    add_sensors();
    schedule_.add_every(kMarkersPeriod_s, [this](double time_s) { publish_markers(time_s); });
  }

  void run() {
    clock_.wait_for([this] { return scan_.getNumSubscribers() > 0 && imu_.getNumSubscribers() > 0; }, 30.0);
    if (!params_.scripted) clock_.wait_for([this] { return commands_.getNumPublishers() > 0; }, 30.0);
    clock_.start();
    double now_s = 0.0;
    while (ros::ok()) {
      const double due_s = schedule_.next_time_s();
      if (due_s > now_s) {
        now_s = due_s;
        clock_.advance(now_s);
        take_command();
        aircraft_.advance(now_s);
      }
      schedule_.step();
    }
  }

 private:
  static FixedWing& aircraft_of(World& world) {
    if (world.aircraft() == nullptr) throw std::runtime_error(world.path() + ": its robot is no fixed_wing");
    return *world.aircraft();
  }

  void add_sensors() {
    std::vector<geometry_msgs::TransformStamped> mounts{
        transform_to_msg(world_.T_robot_lidar(), kSimulationStart_ns, params_.base_frame, params_.lidar_frame)};
    imu_ = add_vehicle_sensors(node_, world_, static_cast<std::uint64_t>(params_.seed), params_.fix_delay_s,
                               params_.base_frame, schedule_, mounts);
    static_tf_.sendTransform(mounts);
    // A scan is there when its last beam has been measured.
    schedule_.add([this] { return scanner_.next_time_s() + scanner_.params().sweep_s; }, [this] { publish_scan(); });
  }

  /// The course over the ground, which the wind makes another than the heading.
  void steer(double time_s) {
    const FixedWingState& state = aircraft_.state();
    const Eigen::Vector2d velocity_m_s = aircraft_.velocity_world_m_s();
    const Pose2 T_world_course{state.T_world_robot.translation_m, std::atan2(velocity_m_s.y(), velocity_m_s.x())};
    aircraft_.command(rounds_->turn_rate(T_world_course, velocity_m_s.norm()));
    if (rounds_->paths() > paths_) publish_path(time_s);
    if (!rounds_->done() || done_published_) return;
    done_published_ = true;
    done_.publish(std_msgs::Empty());
    ROS_INFO("the rounds are flown");
  }

  void take_command() {
    if (params_.scripted) return;
    std::optional<geometry_msgs::Twist> command;
    {
      const std::lock_guard<std::mutex> lock(mutex_);
      std::swap(command, command_);
    }
    if (command) aircraft_.command(command->angular.z);
  }

  void publish_path(double time_s) {
    paths_ = rounds_->paths();
    std::vector<Pose2> poses;
    sample(rounds_->path(), kPathStep_m, poses);
    const double height_m = world_.robot_at(time_s).T_world_robot.translation().z();
    nav_msgs::Path msg;
    msg.header.stamp = to_ros_time(kSimulationStart_ns + nanoseconds(time_s));
    msg.header.frame_id = params_.world_frame;
    for (const Pose2& pose : poses) {
      Eigen::Isometry3d T = isometry_in_plane(pose);
      T.translation().z() = height_m;
      msg.poses.push_back(pose_msg(T, kSimulationStart_ns + nanoseconds(time_s)));
    }
    path_.publish(msg);
  }

  geometry_msgs::PoseStamped pose_msg(const Eigen::Isometry3d& T_world_base, std::int64_t stamp_ns) const {
    const auto tf = transform_to_msg(T_world_base, stamp_ns, params_.world_frame, params_.base_frame);
    geometry_msgs::PoseStamped msg;
    msg.header = tf.header;
    msg.pose = pose_of(tf.transform);
    return msg;
  }

  void publish_true_pose(double time_s) {
    const Eigen::Isometry3d T_world_base = world_.robot_at(time_s).T_world_robot;
    const std::int64_t stamp_ns = kSimulationStart_ns + nanoseconds(time_s);
    true_pose_.publish(pose_msg(T_world_base, stamp_ns));
    if (params_.true_localization) {
      tf_.sendTransform(transform_to_msg(T_world_base, stamp_ns, params_.world_frame, params_.base_frame));
    }
  }

  void publish_scan() {
    ScannerSample sample = scanner_.next();
    sample.scan.stamp_ns += kSimulationStart_ns;
    const SimulatedScannerParams& params = scanner_.params();
    scan_.publish(
        scan_to_msg(sample.scan, params_.lidar_frame, params.range_min_m, params.range_max_m, 1.0 / params.rate_hz));
  }

  void publish_markers(double time_s) {
    if (markers_.getNumSubscribers() == 0) return;
    const double height_m = world_.robot_at(time_s).T_world_robot.translation().z();
    markers_.publish(truth_markers_.update(world_.outlines_at(time_s, height_m), height_m, params_.world_frame,
                                           kSimulationStart_ns + nanoseconds(time_s)));
  }

  AircraftSimulatorParams params_;
  ros::NodeHandle node_;
  SimulatedClock clock_;
  World world_;
  FixedWing& aircraft_;
  SimulatedScanner scanner_;
  Schedule schedule_;
  std::optional<Rounds> rounds_;
  std::size_t paths_ = 0;
  bool done_published_ = false;
  ros::Publisher scan_, imu_, true_pose_, markers_, path_, done_;
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
  ros::init(argc, argv, "aircraft_simulator");
  ros::NodeHandle node;  // outlives the handler below, which needs it for the log
  const ros::NodeHandle private_node("~");
  try {
    situation_awareness::AircraftSimulator simulator(
        node, situation_awareness::ParamReader(private_node)
                  .read<situation_awareness::AircraftSimulatorParams>(situation_awareness::refuse));
    ros::AsyncSpinner spinner(1);
    spinner.start();
    simulator.run();
  } catch (const std::exception& error) {
    ROS_FATAL_STREAM(ros::this_node::getName() << " does not start: " << error.what());
    return 1;
  }
  return 0;
}

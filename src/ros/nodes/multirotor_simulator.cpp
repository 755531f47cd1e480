// SPDX-License-Identifier: BSD-3-Clause
// A simulated multirotor with a camera in place of one's own: it flies to the goals of `go_to`, or to and fro over the
// region, and publishes /clock, what its IMU, its receiver, its altimeter, its compass and its camera measure, and the
// truth for evaluation and rviz.
#include <algorithm>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <memory>
#include <mutex>
#include <optional>
#include <stdexcept>
#include <string>
#include <utility>
#include <vector>

#include <geometry_msgs/PoseStamped.h>
#include <geometry_msgs/PoseWithCovarianceStamped.h>
#include <nav_msgs/Odometry.h>
#include <nav_msgs/Path.h>
#include <ros/ros.h>
#include <sensor_msgs/CameraInfo.h>
#include <sensor_msgs/Image.h>
#include <sensor_msgs/Imu.h>
#include <std_msgs/Empty.h>
#include <tf2_ros/static_transform_broadcaster.h>
#include <tf2_ros/transform_broadcaster.h>
#include <visualization_msgs/MarkerArray.h>

#include "situation_awareness/common/random.hpp"
#include "situation_awareness/common/time.hpp"
#include "situation_awareness/ros/convert/images.hpp"
#include "situation_awareness/ros/convert/odometry.hpp"
#include "situation_awareness/ros/convert/poses.hpp"
#include "situation_awareness/ros/convert/time.hpp"
#include "situation_awareness/ros/params/param_reader.hpp"
#include "situation_awareness/ros/simulated_clock.hpp"
#include "situation_awareness/ros/simulation.hpp"
#include "situation_awareness/ros/vehicle_sensors.hpp"
#include "situation_awareness/sim/guided_multirotor.hpp"
#include "situation_awareness/sim/label_camera.hpp"
#include "situation_awareness/sim/schedule.hpp"
#include "situation_awareness/sim/sensors.hpp"
#include "situation_awareness/sim/world.hpp"

namespace situation_awareness {
namespace {

constexpr double kTruthPeriod_s = 0.02;
constexpr double kPathPeriod_s = 1.0;
constexpr double kHeadingPeriod_s = 0.1;
constexpr double kAltitudePeriod_s = 1.0;
/// Over so many readings filters average, but the error that these have in common stays: it has to be in the variance.
constexpr double kAveragedAltitudes = 10.0, kAveragedHeadings = 50.0;
constexpr double kControlPeriod_s = 0.2;  ///< of the flight to and fro
constexpr double kThere_m = 6.0;          ///< so near to a corner the next one is the goal

struct MultirotorSimulatorParams {
  std::string world = "carpark";
  double rate = 1.0;
  int seed = 1;
  bool scripted = true;
  double half_region_m = 85.0;
  double lane_m = 42.5;
  double fix_delay_s = 0.1;
  bool true_localization = false;
  double heading_sigma_rad = 0.02;
  double altitude_sigma_m = 0.3;
  std::string label_class = "car";
  int label_block_px = 8;
  std::string world_frame = "world";
  std::string base_frame = "base_link";

  template <class Self, class Visit>
  static void fields(Self& self, Visit&& visit) {
    visit("world", self.world, "name of a world in models/worlds, or a path");
    visit("rate", self.rate, Bounds{0.01, 100.0}, "", "simulated seconds per second");
    visit("seed", self.seed, Bounds{0, 2147483647}, "", "seed of the noise");
    visit("scripted", self.scripted, "fly to and fro over the region; false: to the goals of go_to");
    visit("half_region_m", self.half_region_m, Bounds{1.0, 1e4}, "m", "half of the edge of that region");
    visit("lane_m", self.lane_m, Bounds{1.0, 1e4}, "m", "between two lanes of that flight");
    visit("fix_delay_s", self.fix_delay_s, Bounds{0.0, 1.0}, "s", "from the stamp of a fix until it is published");
    visit("true_localization", self.true_localization,
          "publish the true transform from world_frame to base_frame, in the place of a localisation");
    visit("heading_sigma_rad", self.heading_sigma_rad, Bounds{0.0, 1.0}, "rad",
          "of the compass: the same of an error that stays and of one of each reading");
    visit("altitude_sigma_m", self.altitude_sigma_m, Bounds{0.0, 100.0}, "m",
          "of the altimeter, a barometer that was set at the start: the same");
    visit("label_class", self.label_class,
          "labels are the share of a pixel that shows a material whose name begins so");
    visit("label_block_px", self.label_block_px, Bounds{1, 64}, "px",
          "so many pixels of the camera, along both edges, make one of the labels");
    visit("world_frame", self.world_frame, "frame of the truth");
    visit("base_frame", self.base_frame, "frame of the vehicle");
  }
};

/// Corners of lanes over a square.
std::vector<Eigen::Vector2d> lanes(double half_m, double lane_m) {
  std::vector<Eigen::Vector2d> corners;
  const int count = static_cast<int>(std::ceil(2.0 * half_m / lane_m)) + 1;
  for (int i = 0; i < count; ++i) {
    const double y = -half_m + 2.0 * half_m * i / (count - 1);
    const double begin = i % 2 == 0 ? -half_m : half_m;
    corners.emplace_back(begin, y);
    corners.emplace_back(-begin, y);
  }
  return corners;
}

class MultirotorSimulator {
 public:
  MultirotorSimulator(const ros::NodeHandle& node, const MultirotorSimulatorParams& params)
      : params_(params),
        node_(node),
        clock_(node_, params.rate),
        world_(world_file(params.world)),
        multirotor_(multirotor_of(world_)),
        random_(seed_of_sensor(static_cast<std::uint64_t>(params.seed), "heading")),
        altitude_random_(seed_of_sensor(static_cast<std::uint64_t>(params.seed), "altitude")) {
    true_pose_ = node_.advertise<nav_msgs::Odometry>("true_odometry", 200);
    path_ = node_.advertise<nav_msgs::Path>("path", 5, /*latch=*/true);
    schedule_.add_every(kPathPeriod_s, [this](double time_s) { publish_path(time_s); });
    done_ = node_.advertise<std_msgs::Empty>("flight_done", 1, /*latch=*/true);
    if (params.scripted) {
      corners_ = lanes(params.half_region_m, params.lane_m);
      schedule_.add_every(kControlPeriod_s, [this](double) { steer(); });
    } else {
      goals_ = node_.subscribe<geometry_msgs::PoseStamped>("go_to", 10,
                                                           [this](const geometry_msgs::PoseStampedConstPtr& msg) {
                                                             const std::lock_guard<std::mutex> lock(mutex_);
                                                             goal_ = *msg;
                                                           });
    }
    schedule_.add_every(kTruthPeriod_s, [this](double time_s) { publish_true_pose(time_s); });
    std::vector<geometry_msgs::TransformStamped> mounts;
    imu_ = add_vehicle_sensors(node_, world_, static_cast<std::uint64_t>(params.seed), params.fix_delay_s,
                               params.base_frame, schedule_, mounts);
    heading_error_rad_ = params.heading_sigma_rad * random_.normal();
    heading_ = node_.advertise<sensor_msgs::Imu>("heading", 50);
    schedule_.add_every(kHeadingPeriod_s, [this](double time_s) { publish_heading(time_s); });
    const WorldSensors sensors = sensors_of(world_);
    add_altimeter(sensors);
    add_camera(sensors, mounts);
    static_tf_.sendTransform(mounts);
  }

  void run() {
    clock_.wait_for([this] { return labels_.getNumSubscribers() + image_.getNumSubscribers() > 0; }, 30.0);
    if (!params_.scripted) clock_.wait_for([this] { return goals_.getNumPublishers() > 0; }, 30.0);
    clock_.start();
    double now_s = 0.0;
    while (ros::ok()) {
      const double due_s = schedule_.next_time_s();
      if (due_s > now_s) {
        now_s = due_s;
        clock_.advance(now_s);
        take_goal();
        multirotor_.advance(now_s);
      }
      schedule_.step();
    }
  }

 private:
  static GuidedMultirotor& multirotor_of(World& world) {
    if (world.multirotor() == nullptr) throw std::runtime_error(world.path() + ": its robot is no multirotor");
    return *world.multirotor();
  }

  void add_camera(const WorldSensors& sensors, std::vector<geometry_msgs::TransformStamped>& mounts) {
    if (sensors.label_cameras.empty()) throw std::runtime_error(world_.path() + ": it has no label_camera");
    const MountedSensor<SimulatedLabelCameraParams>& mounted = sensors.label_cameras.front();
    camera_frame_ = mounted.name;
    mounts.push_back(transform_to_msg(mounted.T_robot_sensor, kSimulationStart_ns, params_.base_frame, camera_frame_));
    camera_.emplace(world_, mounted.T_robot_sensor, mounted.params);
    const std::vector<std::string>& names = camera_->class_names();
    for (const std::string& name : names) is_class_.push_back(name.rfind(params_.label_class, 0) == 0);
    labels_ = node_.advertise<sensor_msgs::Image>("camera/labels", 20);
    labels_info_ = node_.advertise<sensor_msgs::CameraInfo>("camera/labels_info", 20);
    if (mounted.params.color != 0) image_ = node_.advertise<sensor_msgs::Image>("camera/image", 20);
    camera_info_ = node_.advertise<sensor_msgs::CameraInfo>("camera/camera_info", 20);
    schedule_.add([this] { return camera_->next_time_s(); }, [this] { publish_images(); });
  }

  /// Beside the IMU, if there is one.
  void add_altimeter(const WorldSensors& sensors) {
    if (sensors.imus.empty() || params_.altitude_sigma_m == 0.0) return;
    imu_base_m_ = sensors.imus.front().T_robot_sensor.translation();
    altitude_error_m_ = params_.altitude_sigma_m * altitude_random_.normal();
    altitude_ = node_.advertise<geometry_msgs::PoseWithCovarianceStamped>("altitude", 50);
    schedule_.add_every(kAltitudePeriod_s, [this](double time_s) { publish_altitude(time_s); });
  }

  void publish_images() {
    LabelImage image = camera_->next();
    image.stamp_ns += kSimulationStart_ns;
    labels_info_.publish(labels_info_to_msg(image, params_.label_block_px, camera_frame_));
    labels_.publish(soft_labels_to_msg(image, is_class_, params_.label_block_px, camera_frame_));
    camera_info_.publish(
        camera_info_to_msg(image.width, image.height, image.focal_length_px, image.stamp_ns, camera_frame_));
    if (image_ && image_.getNumSubscribers() > 0) {
      image_.publish(picture_to_msg({image.width, image.height, image.rgb}, image.stamp_ns, camera_frame_));
    }
  }

  /// To the corners, one after the other, and back to where it began.
  void steer() {
    const Eigen::Vector3d p_m = multirotor_.at(multirotor_.time_s()).T_world_robot.translation();
    if (!begin_m_) begin_m_ = p_m;
    const bool is_home = corner_ >= corners_.size();
    const Eigen::Vector2d goal_m = is_home ? Eigen::Vector2d(begin_m_->head<2>()) : corners_[corner_];
    const Eigen::Vector2d to_goal_m = goal_m - p_m.head<2>();
    if (to_goal_m.norm() < kThere_m) {
      if (is_home && !done_published_) {
        done_published_ = true;
        done_.publish(std_msgs::Empty());
        ROS_INFO("the region is flown over");
      }
      if (!is_home) ++corner_;
      return;
    }
    multirotor_.go_to({goal_m.x(), goal_m.y(), begin_m_->z()}, std::atan2(to_goal_m.y(), to_goal_m.x()));
  }

  void take_goal() {
    std::optional<geometry_msgs::PoseStamped> goal;
    {
      const std::lock_guard<std::mutex> lock(mutex_);
      std::swap(goal, goal_);
    }
    if (!goal) return;
    const geometry_msgs::Point& p = goal->pose.position;
    multirotor_.go_to({p.x, p.y, p.z}, pose2_of(goal->pose).yaw_rad);  // ignores what is not finite
  }

  void publish_heading(double time_s) {
    const double yaw_rad = pose2_of(world_.robot_at(time_s).T_world_robot).yaw_rad + heading_error_rad_ +
                           params_.heading_sigma_rad * random_.normal();
    sensor_msgs::Imu msg;
    msg.header.stamp = to_ros_time(kSimulationStart_ns + nanoseconds(time_s));
    msg.header.frame_id = params_.base_frame;
    msg.orientation.z = std::sin(0.5 * yaw_rad);
    msg.orientation.w = std::cos(0.5 * yaw_rad);
    msg.orientation_covariance[8] = (1.0 + kAveragedHeadings) * params_.heading_sigma_rad * params_.heading_sigma_rad;
    msg.angular_velocity_covariance[0] = msg.linear_acceleration_covariance[0] = -1.0;  // it has none
    heading_.publish(msg);
  }

  void publish_altitude(double time_s) {
    geometry_msgs::PoseWithCovarianceStamped msg;
    msg.header.stamp = to_ros_time(kSimulationStart_ns + nanoseconds(time_s));
    msg.header.frame_id = params_.world_frame;
    msg.pose.pose.position.z = (world_.robot_at(time_s).T_world_robot * imu_base_m_).z() + altitude_error_m_ +
                               params_.altitude_sigma_m * altitude_random_.normal();
    msg.pose.pose.orientation.w = 1.0;
    msg.pose.covariance[14] = (1.0 + kAveragedAltitudes) * params_.altitude_sigma_m * params_.altitude_sigma_m;
    altitude_.publish(msg);
  }

  void publish_true_pose(double time_s) {
    const Eigen::Isometry3d T_world_base = world_.robot_at(time_s).T_world_robot;
    const auto tf = transform_to_msg(T_world_base, kSimulationStart_ns + nanoseconds(time_s), params_.world_frame,
                                     params_.base_frame);
    nav_msgs::Odometry msg;
    msg.header = tf.header;
    msg.child_frame_id = tf.child_frame_id;
    msg.pose.pose = pose_of(tf.transform);
    true_pose_.publish(msg);
    if (params_.true_localization) tf_.sendTransform(tf);
  }

  /// The way that it flew.
  void publish_path(double time_s) {
    geometry_msgs::PoseStamped pose;
    const auto tf = transform_to_msg(world_.robot_at(time_s).T_world_robot, kSimulationStart_ns + nanoseconds(time_s),
                                     params_.world_frame, params_.base_frame);
    pose.header = flown_.header = tf.header;
    pose.pose = pose_of(tf.transform);
    flown_.poses.push_back(pose);
    path_.publish(flown_);
  }

  MultirotorSimulatorParams params_;
  ros::NodeHandle node_;
  SimulatedClock clock_;
  World world_;
  GuidedMultirotor& multirotor_;
  Random random_, altitude_random_;
  double heading_error_rad_ = 0.0;  ///< that stays
  double altitude_error_m_ = 0.0;   ///< that stays
  Eigen::Vector3d imu_base_m_ = Eigen::Vector3d::Zero();
  Schedule schedule_;
  std::optional<SimulatedLabelCamera> camera_;
  std::string camera_frame_;
  std::vector<bool> is_class_;  ///< of the camera's classes
  std::vector<Eigen::Vector2d> corners_;
  std::size_t corner_ = 0;
  std::optional<Eigen::Vector3d> begin_m_;
  bool done_published_ = false;
  nav_msgs::Path flown_;
  ros::Publisher imu_, true_pose_, path_, heading_, altitude_, done_, labels_, labels_info_, image_, camera_info_;
  ros::Subscriber goals_;
  tf2_ros::TransformBroadcaster tf_;
  tf2_ros::StaticTransformBroadcaster static_tf_;
  std::mutex mutex_;
  std::optional<geometry_msgs::PoseStamped> goal_;  ///< that came since the last step; under the mutex
};

}  // namespace
}  // namespace situation_awareness

int main(int argc, char** argv) {
  ros::init(argc, argv, "multirotor_simulator");
  ros::NodeHandle node;  // outlives the handler below, which needs it for the log
  const ros::NodeHandle private_node("~");
  try {
    situation_awareness::MultirotorSimulator simulator(
        node, situation_awareness::ParamReader(private_node)
                  .read<situation_awareness::MultirotorSimulatorParams>(situation_awareness::refuse));
    ros::AsyncSpinner spinner(1);
    spinner.start();
    simulator.run();
  } catch (const std::exception& error) {
    ROS_FATAL_STREAM(ros::this_node::getName() << " does not start: " << error.what());
    return 1;
  }
  return 0;
}

// SPDX-License-Identifier: BSD-3-Clause
// A simulated world in place of a robot: /clock, TF, odometry, measurements of its sensors, and the truth for the
// evaluation of maps.
#include <algorithm>
#include <atomic>
#include <memory>
#include <stdexcept>
#include <string>
#include <utility>
#include <vector>

#include <nav_msgs/Odometry.h>
#include <ros/ros.h>
#include <rosgraph_msgs/Clock.h>
#include <sensor_msgs/CameraInfo.h>
#include <sensor_msgs/Image.h>
#include <sensor_msgs/LaserScan.h>
#include <sensor_msgs/PointCloud2.h>
#include <tf2_ros/static_transform_broadcaster.h>
#include <tf2_ros/transform_broadcaster.h>

#include "situation_awareness/common/time.hpp"
#include "situation_awareness/ros/convert/cloud.hpp"
#include "situation_awareness/ros/convert/images.hpp"
#include "situation_awareness/ros/convert/objects.hpp"
#include "situation_awareness/ros/convert/odometry.hpp"
#include "situation_awareness/ros/convert/poses.hpp"
#include "situation_awareness/ros/convert/scan.hpp"
#include "situation_awareness/ros/convert/time.hpp"
#include "situation_awareness/ros/markers/truth_markers.hpp"
#include "situation_awareness/ros/motion_sensors.hpp"
#include "situation_awareness/ros/params/param_reader.hpp"
#include "situation_awareness/ros/simulation.hpp"
#include "situation_awareness/sim/label_camera.hpp"
#include "situation_awareness/sim/ring_scanner.hpp"
#include "situation_awareness/sim/scanner.hpp"
#include "situation_awareness/sim/schedule.hpp"
#include "situation_awareness/sim/sensors.hpp"
#include "situation_awareness/sim/truth.hpp"
#include "situation_awareness/sim/world.hpp"

namespace situation_awareness {
namespace {

constexpr int kPosesPerScan = 5;   ///< TF comes this much faster than scans
constexpr int kMaxScansAhead = 3;  ///< of the map, when running as fast as it goes

struct SimulatorParams {
  std::string world = "demo";
  bool clock = true;
  double rate = 1.0;
  int seed = 1;
  double duration_s = 0.0;
  int rings = 0;
  std::string world_frame = "world";
  std::string robot_frame = "robot";
  std::string lidar_frame = "lidar";

  template <class Self, class Visit>
  static void fields(Self& self, Visit&& visit) {
    visit("world", self.world, "name of a world in models/worlds, or a path");
    visit("clock", self.clock, "publish /clock; false: stamps of the wall clock");
    visit("rate", self.rate, Bounds{0.0, 100.0}, "", "simulated seconds per second; 0: as fast as the map follows");
    visit("seed", self.seed, Bounds{0, 2147483647}, "", "seed of the noise");
    visit("duration_s", self.duration_s, Bounds{0.0, 1e6}, "s", "simulated time until it ends; 0: never");
    visit("rings", self.rings, Bounds{0, 256}, "",
          "rings of a ring scanner that replaces the world's scanners; 0: those of the world");
    visit("world_frame", self.world_frame, "parent frame of the robot's pose in TF");
    visit("robot_frame", self.robot_frame, "frame of the robot's body");
    visit("lidar_frame", self.lidar_frame, "frame of the scans");
  }

  /// Throws std::invalid_argument.
  void validate() const {
    if (!clock && (rate != 1.0 || !ros::Time::isSystemTime())) {
      throw std::invalid_argument("clock = false is the wall clock: it needs rate = 1 and /use_sim_time = false");
    }
  }
};

class Simulator {
 public:
  Simulator(ros::NodeHandle node, const SimulatorParams& params)
      : params_(params), node_(node), world_(world_file(params.world)), sightings_(world_.names().size()) {
    if (params.clock) clock_ = node_.advertise<rosgraph_msgs::Clock>("/clock", 100);
    odometry_ = node_.advertise<nav_msgs::Odometry>("odometry", 100);
    truth_ = node_.advertise<MappedObjectArray>("truth", 50);
    markers_ = node_.advertise<visualization_msgs::MarkerArray>("truth_markers", 10);
    map_ = node_.subscribe<MappedObjectArray>("objects", 50, [this](const MappedObjectArrayConstPtr& msg) {
      mapped_ns_ = std::max(mapped_ns_.load(), to_nanoseconds(msg->header.stamp));
    });
    add_sensors();
  }

  void run() {
    // The first scan waits for a subscriber, and a little for the map: these start more slowly than a simulation.
    wait_for([this] { return first_scan_.getNumSubscribers() > 0; }, 30.0);
    wait_for([this] { return map_.getNumPublishers() > 0; }, 5.0);
    ros::WallTime start = ros::WallTime::now();
    if (!params_.clock) start_ns_ = static_cast<std::int64_t>(start.toNSec());
    publish_clock(start_ns_);
    double now_s = 0.0;
    while (ros::ok()) {
      const double due_s = schedule_.next_time_s();
      if (params_.duration_s > 0.0 && due_s > params_.duration_s) break;
      if (due_s > now_s) {
        now_s = due_s;
        if (params_.rate > 0.0) start = pace(start, now_s / params_.rate);
        publish_clock(start_ns_ + nanoseconds(now_s));
      }
      schedule_.step();
    }
  }

 private:
  /// The sensors of the world, or with `rings` the one that replaces them.
  void add_sensors() {
    WorldSensors sensors = sensors_of(world_);
    if (params_.rings > 0) {
      MountedSensor<SimulatedRingScannerParams> rings{"lidar", world_.T_robot_lidar(), {}};
      rings.params.rings = params_.rings;
      sensors.scanners.clear();
      sensors.ring_scanners = {rings};
    }
    const bool scanner_is_first = !sensors.scanners.empty();
    if (!scanner_is_first && sensors.ring_scanners.empty()) {
      throw std::runtime_error(world_.path() + ": it has no scanner");
    }
    const double scan_rate_hz =
        scanner_is_first ? sensors.scanners.front().params.rate_hz : sensors.ring_scanners.front().params.rate_hz;
    add_poses(kPosesPerScan * scan_rate_hz);  // before the scans: messages due at one time are published in this order
    for (const auto& sensor : sensors.scanners) add_scanner(sensor, &sensor == &sensors.scanners.front());
    for (const auto& sensor : sensors.ring_scanners) {
      add_ring_scanner(sensor, !scanner_is_first && &sensor == &sensors.ring_scanners.front());
    }
    add_motion_sensors(world_, sensors, static_cast<std::uint64_t>(params_.seed), frame_prefix(), names_,
                       [this](const auto& mounted, auto sensor, const std::string& topic, const auto& to_msg) {
                         mount(mounted.name, mounted.T_robot_sensor);
                         using Message = decltype(to_msg(sensor.next()));
                         const ros::Publisher publisher = node_.advertise<Message>(topic, 1000);
                         add(std::move(sensor), [this, publisher, to_msg](auto sample) {
                           sample.stamp_ns += start_ns_;
                           publisher.publish(to_msg(sample));
                         });
                       });
    for (const auto& sensor : sensors.label_cameras) add_label_camera(sensor);
    static_tf_.sendTransform(mounts_);
  }

  void add_poses(double rate_hz) {
    const auto count = std::make_shared<std::uint64_t>(0);
    const auto next_time_s = [count, rate_hz] { return static_cast<double>(*count) / rate_hz; };
    schedule_.add(next_time_s, [this, count, next_time_s] {
      publish_pose(world_.robot_at(next_time_s()), nanoseconds(next_time_s()));
      ++*count;
    });
  }

  /// `is_first` for the scanner whose hits count in the truth.
  void add_scanner(const MountedSensor<SimulatedScannerParams>& sensor, bool is_first) {
    const std::string frame = mount(sensor.name, sensor.T_robot_sensor);
    const ros::Publisher publisher = advertise<sensor_msgs::LaserScan>(sensor.name, "scan", is_first);
    const SimulatedScannerParams& params = sensor.params;
    // The site `lidar` has the simulation's own seed.
    const auto seed = static_cast<std::uint64_t>(params_.seed);
    add(SimulatedScanner(world_, sensor.T_robot_sensor, params,
                         sensor.name == "lidar" ? seed : seed_of_sensor(seed, sensor.name)),
        [this, publisher, frame, params, is_first](ScannerSample sample) {
          const std::int64_t stamp_ns = sample.scan.stamp_ns;
          if (is_first) publish_truth(stamp_ns, sample.hits, sample.hits.size(), sample.T_world_lidar);
          sample.scan.stamp_ns += start_ns_;
          publisher.publish(
              scan_to_msg(sample.scan, frame, params.range_min_m, params.range_max_m, 1.0 / params.rate_hz));
          if (is_first) wait_for_map(stamp_ns, params.rate_hz);
        });
  }

  void add_ring_scanner(const MountedSensor<SimulatedRingScannerParams>& sensor, bool is_first) {
    const std::string frame = mount(sensor.name, sensor.T_robot_sensor);
    const ros::Publisher publisher = advertise<sensor_msgs::PointCloud2>(sensor.name, "points", is_first);
    const double rate_hz = sensor.params.rate_hz;
    add(SimulatedRingScanner(world_, sensor.T_robot_sensor, sensor.params,
                             seed_of_sensor(static_cast<std::uint64_t>(params_.seed), sensor.name)),
        [this, publisher, frame, rate_hz, is_first](RingScannerSample sample) {
          const std::int64_t stamp_ns = sample.cloud.stamp_ns;
          if (is_first) publish_truth(stamp_ns, sample.hits, sample.cloud.columns, sample.T_world_sensor);
          sample.cloud.stamp_ns += start_ns_;
          publisher.publish(cloud_to_msg(sample.cloud, frame));
          if (is_first) wait_for_map(stamp_ns, rate_hz);
        });
  }

  /// It draws only while there are subscribers: each image takes time.
  void add_label_camera(const MountedSensor<SimulatedLabelCameraParams>& sensor) {
    const std::string frame = mount(sensor.name, sensor.T_robot_sensor);
    const std::string topic = names_.of(sensor.name, "label_camera");
    const bool has_colors = sensor.params.color != 0;
    const ros::Publisher info = node_.advertise<sensor_msgs::CameraInfo>(topic + "/camera_info", 50);
    const ros::Publisher objects = node_.advertise<sensor_msgs::Image>(topic + "/objects", 50);
    const ros::Publisher classes = node_.advertise<sensor_msgs::Image>(topic + "/classes", 50);
    const ros::Publisher picture =
        has_colors ? node_.advertise<sensor_msgs::Image>(topic + "/image", 50) : ros::Publisher();
    const auto camera = std::make_shared<SimulatedLabelCamera>(world_, sensor.T_robot_sensor, sensor.params);
    schedule_.add(
        [camera] { return camera->next_time_s(); },
        [this, camera, frame, has_colors, info, objects, classes, picture] {
          const auto is_heard = [](const ros::Publisher& p) { return p.getNumSubscribers() > 0; };
          if (!is_heard(info) && !is_heard(objects) && !is_heard(classes) && !is_heard(picture)) {
            camera->skip();
            return;
          }
          LabelImage image = camera->next();
          image.stamp_ns += start_ns_;
          info.publish(camera_info_to_msg(image.width, image.height, image.focal_length_px, image.stamp_ns, frame));
          objects.publish(objects_image_to_msg(image, frame));
          classes.publish(classes_image_to_msg(image, frame));
          if (has_colors) {
            picture.publish(picture_to_msg({image.width, image.height, image.rgb}, image.stamp_ns, frame));
          }
        });
  }

  template <class Sensor, class Publish>
  void add(Sensor sensor, const Publish& publish) {
    const auto shared = std::make_shared<Sensor>(std::move(sensor));
    schedule_.add([shared] { return shared->next_time_s(); }, [shared, publish] { publish(shared->next()); });
  }

  /// The first sensor of a kind publishes on the plain topic, others below their own name.
  template <class Message>
  ros::Publisher advertise(const std::string& name, const std::string& topic, bool is_first_scan) {
    const ros::Publisher publisher = node_.advertise<Message>(names_.of(name, topic), 50);
    if (is_first_scan) first_scan_ = publisher;
    return publisher;
  }

  /// The name of the robot, before frames of its own.
  std::string frame_prefix() const { return params_.robot_frame.substr(0, params_.robot_frame.rfind('/') + 1); }

  /// The frame of a sensor; publishes its mounting in TF.
  std::string mount(const std::string& name, const Eigen::Isometry3d& T_robot_sensor) {
    const std::string& robot = params_.robot_frame;
    const std::string frame = name == "lidar" ? params_.lidar_frame : frame_prefix() + name;
    mounts_.push_back(transform_to_msg(T_robot_sensor, start_ns_, robot, frame));
    return frame;
  }

  /// Sleep until `elapsed_s` after `start`. If far behind, continue from now as if started later: catching up would
  /// overload the map.
  static ros::WallTime pace(const ros::WallTime& start, double elapsed_s) {
    const ros::WallDuration elapsed(elapsed_s), far_behind(0.25);
    const ros::WallDuration left = start + elapsed - ros::WallTime::now();
    if (left > ros::WallDuration(0.0)) left.sleep();
    return left < -far_behind ? ros::WallTime::now() - elapsed : start;
  }

  /// Publish the clock until `there` or until the timeout.
  template <class Condition>
  void wait_for(const Condition& there, double timeout_s) {
    const ros::WallTime end = ros::WallTime::now() + ros::WallDuration(timeout_s);
    while (ros::ok() && !there() && ros::WallTime::now() < end) {
      publish_clock(start_ns_);
      ros::WallDuration(0.05).sleep();
    }
  }

  /// With rate 0 the simulation waits for the map: otherwise all queues would overflow.
  void wait_for_map(std::int64_t scan_ns, double rate_hz) const {
    if (params_.rate > 0.0) return;
    if (map_.getNumPublishers() == 0) {
      ros::WallDuration(0.002).sleep();
      return;
    }
    const std::int64_t stamp_ns = start_ns_ + scan_ns - nanoseconds(kMaxScansAhead / rate_hz);
    const ros::WallTime deadline = ros::WallTime::now() + ros::WallDuration(0.2);
    while (ros::ok() && mapped_ns_ < stamp_ns && ros::WallTime::now() < deadline) ros::WallDuration(0.0005).sleep();
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
    msg.pose.pose = pose_of(tf.transform);
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

  void publish_truth(std::int64_t stamp_ns, const std::vector<TrueHit>& hits, std::size_t columns,
                     const Eigen::Isometry3d& T_world_lidar) {
    sightings_.add(stamp_ns, hits, columns);
    Objects truth = true_map(world_, sightings_, seconds_between(0, stamp_ns), T_world_lidar.translation().z());
    truth.stamp_ns += start_ns_;
    for (Object& object : truth.objects) {
      object.first_seen_ns += start_ns_;
      object.last_seen_ns += start_ns_;
    }
    std::vector<std::string> names;
    for (const Object& object : truth.objects) names.push_back(world_.names()[object.id - 1]);
    truth_.publish(objects_to_msg(truth, params_.world_frame, names));
    if (markers_.getNumSubscribers() == 0) return;
    markers_.publish(truth_markers_.update(world_.objects_at(seconds_between(0, stamp_ns)), world_.names(),
                                           truth.height_world_m, params_.world_frame, truth.stamp_ns));
  }

  SimulatorParams params_;
  ros::NodeHandle node_;
  std::int64_t start_ns_ = kSimulationStart_ns;  ///< stamp of the first scan
  World world_;
  Sightings sightings_;
  Schedule schedule_;
  SensorNames names_;
  std::vector<geometry_msgs::TransformStamped> mounts_;
  ros::Publisher clock_, odometry_, first_scan_, truth_, markers_;
  ros::Subscriber map_;
  tf2_ros::TransformBroadcaster tf_;
  tf2_ros::StaticTransformBroadcaster static_tf_;
  TruthMarkers truth_markers_;
  std::atomic<std::int64_t> mapped_ns_{0};
};

}  // namespace
}  // namespace situation_awareness

int main(int argc, char** argv) {
  ros::init(argc, argv, "simulator");
  ros::NodeHandle node;  // outlives the handler below, which needs it for the log
  const ros::NodeHandle private_node("~");
  try {
    situation_awareness::Simulator simulator(
        node, situation_awareness::ParamReader(private_node)
                  .read<situation_awareness::SimulatorParams>(situation_awareness::refuse));
    ros::AsyncSpinner spinner(1);
    spinner.start();
    simulator.run();
    ros::WallDuration(0.5).sleep();  // the last messages are still in transit
  } catch (const std::exception& error) {
    ROS_FATAL_STREAM(ros::this_node::getName() << " does not start: " << error.what());
    return 1;
  }
  return 0;
}

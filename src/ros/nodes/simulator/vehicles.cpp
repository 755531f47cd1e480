// SPDX-License-Identifier: BSD-3-Clause
#include "vehicles.hpp"

#include <algorithm>
#include <cmath>
#include <optional>
#include <string>
#include <utility>

#include <geometry_msgs/PoseStamped.h>
#include <geometry_msgs/PoseWithCovarianceStamped.h>
#include <geometry_msgs/Twist.h>
#include <nav_msgs/Odometry.h>
#include <nav_msgs/Path.h>
#include <ros/callback_queue.h>
#include <ros/console.h>
#include <sensor_msgs/Imu.h>
#include <std_msgs/Empty.h>

#include "situation_awareness/Transit.h"
#include "situation_awareness/common/time.hpp"
#include "situation_awareness/path/rounds.hpp"
#include "situation_awareness/ros/convert/motion_sensors.hpp"
#include "situation_awareness/ros/convert/objects.hpp"
#include "situation_awareness/ros/convert/odometry.hpp"
#include "situation_awareness/ros/convert/poses.hpp"
#include "situation_awareness/ros/convert/time.hpp"
#include "situation_awareness/ros/markers/truth_markers.hpp"
#include "situation_awareness/sim/fixed_wing.hpp"
#include "situation_awareness/sim/guided_multirotor.hpp"
#include "situation_awareness/sim/lanes_flight.hpp"
#include "situation_awareness/sim/standing_error.hpp"
#include "situation_awareness/sim/unicycle.hpp"

namespace situation_awareness {
namespace {

constexpr double kTruthPeriod_s = 0.02;  ///< of those that fly

geometry_msgs::PoseStamped pose_msg(const geometry_msgs::TransformStamped& tf) {
  geometry_msgs::PoseStamped msg;
  msg.header = tf.header;
  msg.pose = pose_of(tf.transform);
  return msg;
}

nav_msgs::Odometry odometry_msg(const geometry_msgs::TransformStamped& tf) {
  nav_msgs::Odometry msg;
  msg.header = tf.header;
  msg.child_frame_id = tf.child_frame_id;
  msg.pose.pose = pose_of(tf.transform);
  return msg;
}

geometry_msgs::Vector3 vector_msg(const Eigen::Vector3d& vector) {
  geometry_msgs::Vector3 msg;
  msg.x = vector.x();
  msg.y = vector.y();
  msg.z = vector.z();
  return msg;
}

/// A robot on the path of the world's file: TF and odometry are exact, and the truth is that of a map of objects.
class PathVehicle : public SimulatedVehicle {
 public:
  explicit PathVehicle(Simulation& simulation) : SimulatedVehicle(simulation), sightings_(world_.names().size()) {
    need_scanner();
    odometry_ = advertise<nav_msgs::Odometry>("odometry", 100);
    truth_ = advertise<MappedObjectArray>("truth", 50);
    markers_ = advertise<visualization_msgs::MarkerArray>("truth_markers", 10);
    follow<MappedObjectArray>("objects", [this](const MappedObjectArray& msg) {
      mapped_ns_ = std::max(mapped_ns_, to_nanoseconds(msg.header.stamp));
    });
    const WorldSensors& sensors = simulation.sensors;
    scan_rate_hz_ = sensors.scanners.empty() ? sensors.ring_scanners.front().params.rate_hz
                                             : sensors.scanners.front().params.rate_hz;
    const auto next_time_s = [this] { return static_cast<double>(poses_) / (kPosesPerScan * scan_rate_hz_); };
    simulation.schedule.add(next_time_s, [this, next_time_s] {
      publish_pose(next_time_s());
      ++poses_;
    });
  }

  void scanned(const ScanTruth& scan) override {
    publish_truth(scan);
    if (params_.rate == 0.0) wait_for_map(scan);
  }

 private:
  static constexpr int kPosesPerScan = 5;   ///< TF comes this much faster than scans
  static constexpr int kMaxScansAhead = 3;  ///< of the map, when running as fast as it goes

  void publish_pose(double time_s) {
    const auto tf = true_transform(time_s);
    simulation_.tf.sendTransform(tf);
    nav_msgs::Odometry msg = odometry_msg(tf);
    const RobotState robot = world_.robot_at(time_s);
    const Eigen::Vector3d velocity_robot_m_s =  // nav_msgs: the twist is in the child's frame
        robot.T_world_robot.linear().transpose() * robot.velocity_world_m_s;
    msg.twist.twist.linear = vector_msg(velocity_robot_m_s);
    msg.twist.twist.angular = vector_msg(robot.angular_velocity_robot_rad_s);
    odometry_.publish(msg);
  }

  void publish_truth(const ScanTruth& scan) {
    const double time_s = seconds_between(0, scan.stamp_ns);
    sightings_.add(scan.stamp_ns, scan.hits, scan.columns);
    Objects truth = true_map(world_, sightings_, time_s, scan.T_world_sensor.translation().z());
    const std::int64_t start_ns = simulation_.clock.start_ns();
    truth.stamp_ns += start_ns;
    std::vector<std::string> names;
    for (Object& object : truth.objects) {
      object.first_seen_ns += start_ns;
      object.last_seen_ns += start_ns;
      names.push_back(world_.names()[object.id - 1]);
    }
    truth_.publish(objects_to_msg(truth, params_.world_frame, names));
    if (markers_.getNumSubscribers() == 0) return;
    markers_.publish(truth_markers_.update(world_.objects_at(time_s), world_.names(), truth.height_world_m,
                                           params_.world_frame, truth.stamp_ns));
  }

  /// With rate 0 the simulation waits for the map: otherwise all queues would overflow.
  void wait_for_map(const ScanTruth& scan) const {
    if (leader_.getNumPublishers() == 0) {
      ros::WallDuration(0.002).sleep();
      return;
    }
    const std::int64_t stamp_ns =
        simulation_.clock.start_ns() + scan.stamp_ns - nanoseconds(kMaxScansAhead / scan_rate_hz_);
    const ros::WallTime deadline = ros::WallTime::now() + ros::WallDuration(0.2);
    while (ros::ok() && mapped_ns_ < stamp_ns && ros::WallTime::now() < deadline) {
      ros::getGlobalCallbackQueue()->callAvailable(ros::WallDuration(0.0005));
    }
  }

  Sightings sightings_;
  double scan_rate_hz_ = 0.0;
  std::uint64_t poses_ = 0;
  std::int64_t mapped_ns_ = 0;
  ros::Publisher odometry_, truth_, markers_;
  TruthMarkers truth_markers_;
};

/// A vehicle on wheels that is driven by `cmd_vel` from dock to dock through a world that changes meanwhile.
class UnicycleVehicle : public SimulatedVehicle {
 public:
  explicit UnicycleVehicle(Simulation& simulation)
      : SimulatedVehicle(simulation), transits_(world_, params_.transits), odometry_(take_odometry()) {
    need_scanner();
    odom_ = advertise<nav_msgs::Odometry>("odom", 100);
    true_pose_ = advertise<geometry_msgs::PoseStamped>("true_pose", 100);
    transit_ = advertise<Transit>("transit", 10, /*latch=*/true);
    markers_ = advertise<visualization_msgs::MarkerArray>("truth_markers", 10);
    follow<geometry_msgs::Twist>("cmd_vel", [this](const geometry_msgs::Twist& command) {
      transits_.command(command.linear.x, command.angular.z);
    });
    simulation.schedule.add([this] { return odometry_.next_time_s(); }, [this] { publish_odometry(); });
    simulation.schedule.add_every(kMarkersPeriod_s, [this](double time_s) { publish_markers(time_s); });
  }

  void start() override { publish_transit(); }

  void advance(double time_s) override {
    const bool was_docked = transits_.docked();
    transits_.advance(time_s);
    if (transits_.docked() != was_docked) publish_transit();
  }

  bool scans(double time_s) const override { return !transits_.docked() && time_s >= transits_.begin_s(); }

  void scanned(const ScanTruth& scan) override {
    true_pose_.publish(pose_msg(true_transform(seconds_between(0, scan.stamp_ns))));
  }

 private:
  static constexpr double kMarkersPeriod_s = 0.2;

  /// It leads the way in TF, and so is no sensor among others.
  SimulatedOdometry take_odometry() {
    const auto odometries = std::exchange(simulation_.sensors.odometries, {});
    if (odometries.size() != 1) {
      throw std::runtime_error(world_.path() + ": a vehicle needs one sensor of the kind odometry");
    }
    const auto& odometry = odometries.front();
    if (!odometry.T_robot_sensor.isApprox(Eigen::Isometry3d::Identity(), 1e-9)) {
      throw std::runtime_error(world_.path() + ": the odometry '" + odometry.name + "' is not at the robot's origin");
    }
    return {world_, odometry.T_robot_sensor, odometry.params, seed_of_sensor(simulation_.seed(), odometry.name)};
  }

  void publish_odometry() {
    OdometrySample sample = odometry_.next();
    const Eigen::Isometry3d T_world_base = world_.robot_at(seconds_between(0, sample.stamp_ns)).T_world_robot;
    sample.stamp_ns += simulation_.clock.start_ns();
    const Eigen::Isometry3d T_odom_base = isometry_in_plane(sample.T_odom_base);
    if (params_.true_localization) {
      simulation_.tf.sendTransform(transform_to_msg(T_world_base * T_odom_base.inverse(), sample.stamp_ns,
                                                    params_.world_frame, params_.odom_frame));
    }
    simulation_.tf.sendTransform(
        transform_to_msg(T_odom_base, sample.stamp_ns, params_.odom_frame, params_.robot_frame));
    odom_.publish(odometry_to_msg(sample, params_.odom_frame, params_.robot_frame));
  }

  /// What stands, at the height of the scanner.
  std::vector<TrueOutline> outlines() const {
    const double time_s = world_.vehicle()->time_s();
    return world_.outlines_at(
        time_s, world_.robot_at(time_s).T_world_robot.translation().z() + world_.T_robot_lidar().translation().z());
  }

  void publish_transit() {
    Transit msg;
    msg.header.stamp = to_ros_time(stamp_ns(transits_.docked() ? transits_.end_s() : transits_.begin_s()));
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
    markers_.publish(truth_markers_.update(outlines(), 0.0, params_.world_frame, stamp_ns(time_s)));
  }

  Transits transits_;
  SimulatedOdometry odometry_;
  ros::Publisher odom_, true_pose_, transit_, markers_;
  TruthMarkers truth_markers_;
};

/// What those that fly have in common: a path, and an end where they follow a script.
class Flyer : public SimulatedVehicle {
 protected:
  using SimulatedVehicle::SimulatedVehicle;

  void advertise_flight() {
    path_ = advertise<nav_msgs::Path>("path", 5, /*latch=*/true);
    done_ = advertise<std_msgs::Empty>("flight_done", 1, /*latch=*/true);
  }

  /// The true pose, as the message that `to_msg` makes of it.
  template <class ToMsg>
  void add_true_pose(const std::string& topic, const ToMsg& to_msg) {
    const auto publisher = advertise<decltype(to_msg({}))>(topic, 200);
    simulation_.schedule.add_every(kTruthPeriod_s, [this, publisher, to_msg](double time_s) {
      const auto tf = true_transform(time_s);
      publisher.publish(to_msg(tf));
      if (params_.true_localization) simulation_.tf.sendTransform(tf);
    });
  }

  void publish_done() {
    if (std::exchange(done_published_, true)) return;
    done_.publish(std_msgs::Empty());
    ROS_INFO("the flight is done");
  }

  ros::Publisher path_;

 private:
  ros::Publisher done_;
  bool done_published_ = false;
};

/// A vehicle on wings that is turned by `cmd_vel`, or flies scripted rounds.
class FixedWingVehicle : public Flyer {
 public:
  explicit FixedWingVehicle(Simulation& simulation) : Flyer(simulation), aircraft_(*world_.aircraft()) {
    need_scanner();
    markers_ = advertise<visualization_msgs::MarkerArray>("truth_markers", 10);
    if (params_.scripted) {
      advertise_flight();
      std::vector<Eigen::Vector3d> circles = world_.rounds();
      if (params_.rounds > 0) circles.resize(std::min(circles.size(), static_cast<std::size_t>(params_.rounds)));
      rounds_.emplace(circles, params_.flight, 1.0 / aircraft_.params().radius_m);
      simulation.schedule.add_every(kControlPeriod_s, [this](double time_s) { steer(time_s); });
    } else {
      follow<geometry_msgs::Twist>(
          "cmd_vel", [this](const geometry_msgs::Twist& command) { aircraft_.command(command.angular.z); });
    }
    add_true_pose("true_pose", pose_msg);
    simulation.schedule.add_every(kMarkersPeriod_s, [this](double time_s) { publish_markers(time_s); });
  }

  bool is_heard(const SensorTopics& topics) const override {
    return SimulatedVehicle::is_heard(topics) && (!topics.imu || topics.imu.getNumSubscribers() > 0);
  }

  void advance(double time_s) override { aircraft_.advance(time_s); }

 private:
  static constexpr double kMarkersPeriod_s = 0.5;
  static constexpr double kControlPeriod_s = 0.05;
  static constexpr double kPathStep_m = 0.5;

  void steer(double time_s) {
    aircraft_.command(rounds_->turn_rate(aircraft_.T_world_course(), aircraft_.velocity_world_m_s().norm()));
    if (rounds_->paths() > paths_) publish_path(time_s);
    if (rounds_->done()) publish_done();
  }

  void publish_path(double time_s) {
    paths_ = rounds_->paths();
    std::vector<Pose2> poses;
    sample(rounds_->path(), kPathStep_m, poses);
    const double height_m = world_.robot_at(time_s).T_world_robot.translation().z();
    nav_msgs::Path msg;
    for (const Pose2& pose : poses) {
      Eigen::Isometry3d T = isometry_in_plane(pose);
      T.translation().z() = height_m;
      msg.poses.push_back(pose_msg(transform_to_msg(T, stamp_ns(time_s), params_.world_frame, params_.robot_frame)));
    }
    msg.header = msg.poses.front().header;
    path_.publish(msg);
  }

  void publish_markers(double time_s) {
    if (markers_.getNumSubscribers() == 0) return;
    const double height_m = world_.robot_at(time_s).T_world_robot.translation().z();
    markers_.publish(
        truth_markers_.update(world_.outlines_at(time_s, height_m), height_m, params_.world_frame, stamp_ns(time_s)));
  }

  FixedWing& aircraft_;
  std::optional<Rounds> rounds_;
  std::size_t paths_ = 0;
  ros::Publisher markers_;
  TruthMarkers truth_markers_;
};

/// A multirotor with compass and altimeter that flies to the goals of `go_to`, or to and fro over the region.
class MultirotorVehicle : public Flyer {
 public:
  explicit MultirotorVehicle(Simulation& simulation)
      : Flyer(simulation),
        multirotor_(*world_.multirotor()),
        heading_error_(params_.heading_sigma_rad, seed_of_sensor(simulation.seed(), "heading")),
        altitude_error_(params_.altitude_sigma_m, seed_of_sensor(simulation.seed(), "altitude")) {
    const WorldSensors& sensors = simulation.sensors;
    if (sensors.label_cameras.empty()) throw std::runtime_error(world_.path() + ": it has no label_camera");
    advertise_flight();
    Schedule& schedule = simulation.schedule;
    schedule.add_every(kPathPeriod_s, [this](double time_s) { publish_path(time_s); });
    if (params_.scripted) {
      lanes_.emplace(multirotor_, params_.half_region_m, params_.lane_m);
      schedule.add_every(kControlPeriod_s, [this](double) {
        lanes_->steer();
        if (lanes_->done()) publish_done();
      });
    } else {
      follow<geometry_msgs::PoseStamped>("go_to", [this](const geometry_msgs::PoseStamped& goal) {
        const geometry_msgs::Point& p = goal.pose.position;
        multirotor_.go_to({p.x, p.y, p.z}, pose2_of(goal.pose).yaw_rad);  // ignores what is not finite
      });
    }
    add_true_pose("true_odometry", odometry_msg);
    heading_ = advertise<sensor_msgs::Imu>("heading", 50);
    schedule.add_every(kHeadingPeriod_s, [this](double time_s) { publish_heading(time_s); });
    if (sensors.imus.empty() || params_.altitude_sigma_m == 0.0) return;
    imu_base_m_ = sensors.imus.front().T_robot_sensor.translation();
    altitude_ = advertise<geometry_msgs::PoseWithCovarianceStamped>("altitude", 50);
    schedule.add_every(kAltitudePeriod_s, [this](double time_s) { publish_altitude(time_s); });
  }

  bool is_heard(const SensorTopics& topics) const override {
    return std::any_of(topics.images.begin(), topics.images.end(),
                       [](const ros::Publisher& images) { return images.getNumSubscribers() > 0; });
  }

  void advance(double time_s) override { multirotor_.advance(time_s); }

 private:
  static constexpr double kPathPeriod_s = 1.0;
  static constexpr double kHeadingPeriod_s = 0.1;
  static constexpr double kAltitudePeriod_s = 1.0;
  static constexpr double kAveragedAltitudes = 10.0, kAveragedHeadings = 50.0;  ///< by filters of them
  static constexpr double kControlPeriod_s = 0.2;

  void publish_heading(double time_s) {
    const double yaw_rad = heading_error_.reading_of(pose2_of(world_.robot_at(time_s).T_world_robot).yaw_rad);
    sensor_msgs::Imu msg;
    msg.header.stamp = to_ros_time(stamp_ns(time_s));
    msg.header.frame_id = params_.robot_frame;
    msg.orientation.z = std::sin(0.5 * yaw_rad);
    msg.orientation.w = std::cos(0.5 * yaw_rad);
    msg.orientation_covariance[8] = heading_error_.variance(kAveragedHeadings);
    msg.angular_velocity_covariance[0] = msg.linear_acceleration_covariance[0] = -1.0;  // it has none
    heading_.publish(msg);
  }

  /// Publishes the height of the IMU, beside which the altimeter is.
  void publish_altitude(double time_s) {
    geometry_msgs::PoseWithCovarianceStamped msg;
    msg.header.stamp = to_ros_time(stamp_ns(time_s));
    msg.header.frame_id = params_.world_frame;
    msg.pose.pose.position.z = altitude_error_.reading_of((world_.robot_at(time_s).T_world_robot * imu_base_m_).z());
    msg.pose.pose.orientation.w = 1.0;
    msg.pose.covariance[14] = altitude_error_.variance(kAveragedAltitudes);
    altitude_.publish(msg);
  }

  /// The way that it flew.
  void publish_path(double time_s) {
    flown_.poses.push_back(pose_msg(true_transform(time_s)));
    flown_.header = flown_.poses.back().header;
    path_.publish(flown_);
  }

  GuidedMultirotor& multirotor_;
  StandingError heading_error_, altitude_error_;
  Eigen::Vector3d imu_base_m_ = Eigen::Vector3d::Zero();
  std::optional<LanesFlight> lanes_;
  nav_msgs::Path flown_;
  ros::Publisher heading_, altitude_;
};

}  // namespace

void SimulatedVehicle::need_scanner() const {
  const WorldSensors& sensors = simulation_.sensors;
  if (sensors.scanners.empty() && sensors.ring_scanners.empty()) {
    throw std::runtime_error(world_.path() + ": it has no scanner");
  }
}

geometry_msgs::TransformStamped SimulatedVehicle::true_transform(double time_s) const {
  return transform_to_msg(world_.robot_at(time_s).T_world_robot, stamp_ns(time_s), params_.world_frame,
                          params_.robot_frame);
}

std::unique_ptr<SimulatedVehicle> make_vehicle(Simulation& simulation) {
  switch (simulation.params.vehicle) {
    case VehicleKind::kUnicycle:
      return std::make_unique<UnicycleVehicle>(simulation);
    case VehicleKind::kFixedWing:
      return std::make_unique<FixedWingVehicle>(simulation);
    case VehicleKind::kMultirotor:
      return std::make_unique<MultirotorVehicle>(simulation);
    default:
      return std::make_unique<PathVehicle>(simulation);
  }
}

}  // namespace situation_awareness

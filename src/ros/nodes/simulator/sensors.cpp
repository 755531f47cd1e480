// SPDX-License-Identifier: BSD-3-Clause
#include "sensors.hpp"

#include <algorithm>
#include <array>
#include <memory>
#include <string>
#include <type_traits>
#include <utility>
#include <vector>

#include <sensor_msgs/CameraInfo.h>
#include <sensor_msgs/Image.h>
#include <sensor_msgs/Imu.h>
#include <sensor_msgs/LaserScan.h>
#include <sensor_msgs/NavSatFix.h>
#include <sensor_msgs/PointCloud2.h>
#include <tf2_ros/static_transform_broadcaster.h>

#include "situation_awareness/ros/convert/cloud.hpp"
#include "situation_awareness/ros/convert/images.hpp"
#include "situation_awareness/ros/convert/poses.hpp"
#include "situation_awareness/ros/convert/scan.hpp"
#include "situation_awareness/ros/motion_sensors.hpp"
#include "situation_awareness/sim/label_camera.hpp"
#include "situation_awareness/sim/ring_scanner.hpp"
#include "situation_awareness/sim/scanner.hpp"

namespace situation_awareness {
namespace {

class SensorPublishers {
 public:
  SensorPublishers(Simulation& simulation, SimulatedVehicle& vehicle)
      : simulation_(simulation),
        vehicle_(vehicle),
        prefix_(simulation.params.robot_frame.substr(0, simulation.params.robot_frame.rfind('/') + 1)) {}

  SensorTopics add_all() {
    add_scanners();
    const WorldSensors& sensors = simulation_.sensors;
    add_motion_sensors(simulation_.world, sensors, simulation_.seed(), prefix_, names_,
                       [this](const auto& mounted, auto sensor, const std::string& topic, const auto& to_msg) {
                         add_motion_sensor(mounted, std::move(sensor), topic, to_msg);
                       });
    for (const auto& mounted : sensors.label_cameras) add_label_camera(mounted);
    simulation_.static_tf.sendTransform(mounts_);
    return topics_;
  }

 private:
  void add_scanners() {
    for (const auto& mounted : simulation_.sensors.scanners) {
      // The site `lidar` has the simulation's own seed.
      const std::uint64_t seed =
          mounted.name == "lidar" ? simulation_.seed() : seed_of_sensor(simulation_.seed(), mounted.name);
      add_scanner<sensor_msgs::LaserScan, SimulatedScanner>(
          mounted, seed, "scan", [params = mounted.params](const ScannerSample& sample, const std::string& frame) {
            return scan_to_msg(sample.scan, frame, params.range_min_m, params.range_max_m, 1.0 / params.rate_hz);
          });
    }
    for (const auto& mounted : simulation_.sensors.ring_scanners) {
      add_scanner<sensor_msgs::PointCloud2, SimulatedRingScanner>(
          mounted, seed_of_sensor(simulation_.seed(), mounted.name), "points",
          [](const RingScannerSample& sample, const std::string& frame) { return cloud_to_msg(sample.cloud, frame); });
    }
  }

  static ScanTruth truth_of(const ScannerSample& sample) {
    return {sample.scan.stamp_ns, sample.hits, sample.hits.size(), sample.T_world_lidar};
  }
  static ScanTruth truth_of(const RingScannerSample& sample) {
    return {sample.cloud.stamp_ns, sample.hits, sample.cloud.columns, sample.T_world_sensor};
  }
  static std::int64_t& stamp_of(ScannerSample& sample) { return sample.scan.stamp_ns; }
  static std::int64_t& stamp_of(RingScannerSample& sample) { return sample.cloud.stamp_ns; }

  template <class Message, class Scanner, class Mounted, class ToMsg>
  void add_scanner(const Mounted& mounted, std::uint64_t seed, const std::string& topic, const ToMsg& to_msg) {
    const ros::Publisher publisher = simulation_.node.advertise<Message>(names_.of(mounted.name, topic), 50);
    const bool is_first = !topics_.scan;
    if (is_first) topics_.scan = publisher;
    const auto scanner = std::make_shared<Scanner>(simulation_.world, mounted.T_robot_sensor, mounted.params, seed);
    simulation_.schedule.add(
        [scanner, later_s = later(mounted.params.sweep_s)] { return scanner->next_time_s() + later_s; },
        [&simulation = simulation_, &vehicle = vehicle_, scanner, publisher, to_msg, is_first, frame = mount(mounted)] {
          if (!vehicle.scans(scanner->next_time_s())) return scanner->skip();
          auto sample = scanner->next();
          const ScanTruth truth = truth_of(sample);
          stamp_of(sample) += simulation.clock.start_ns();
          publisher.publish(to_msg(sample, frame));
          if (is_first) vehicle.scanned(truth);
        });
  }

  template <class Mounted, class Sensor, class ToMsg>
  void add_motion_sensor(const Mounted& mounted, Sensor sensor, const std::string& topic, const ToMsg& to_msg) {
    using Message = decltype(to_msg(sensor.next()));
    mount(mounted);
    const ros::Publisher publisher = simulation_.node.advertise<Message>(topic, 1000);
    double later_s = 0.0;
    if constexpr (std::is_same_v<Message, sensor_msgs::Imu>) {
      topics_.imu = publisher;
      later_s = later(0.5 / mounted.params.rate_hz);  // a sample is the mean over its period
    } else if constexpr (std::is_same_v<Message, sensor_msgs::NavSatFix>) {
      later_s = later(simulation_.params.fix_delay_s);
    }
    const auto shared = std::make_shared<Sensor>(std::move(sensor));
    simulation_.schedule.add([shared, later_s] { return shared->next_time_s() + later_s; },
                             [&simulation = simulation_, shared, publisher, to_msg] {
                               auto sample = shared->next();
                               sample.stamp_ns += simulation.clock.start_ns();
                               publisher.publish(to_msg(sample));
                             });
  }

  /// It draws only while there are subscribers: each image takes time, and drawing needs EGL.
  void add_label_camera(const MountedSensor<SimulatedLabelCameraParams>& mounted) {
    const SimulatorParams& params = simulation_.params;
    const std::string topic =
        names_.of(mounted.name, params.vehicle == VehicleKind::kMultirotor ? "camera" : "label_camera");
    const auto advertise_image = [&](const char* name) {
      return simulation_.node.advertise<sensor_msgs::Image>(topic + name, 50);
    };
    const ros::Publisher objects = advertise_image("/objects"), classes = advertise_image("/classes"),
                         labels = advertise_image("/labels"),
                         picture = mounted.params.color != 0 ? advertise_image("/image") : ros::Publisher(),
                         info = simulation_.node.advertise<sensor_msgs::CameraInfo>(topic + "/camera_info", 50),
                         labels_info = simulation_.node.advertise<sensor_msgs::CameraInfo>(topic + "/labels_info", 50);
    topics_.images.insert(topics_.images.end(), {labels, picture});
    const auto camera =
        std::make_shared<SimulatedLabelCamera>(simulation_.world, mounted.T_robot_sensor, mounted.params);
    simulation_.schedule.add(
        [camera] { return camera->next_time_s(); },
        [=, &simulation = simulation_, frame = mount(mounted), wanted = params.label_class,
         block_px = params.label_block_px] {
          const auto is_heard = [](const ros::Publisher& p) { return p.getNumSubscribers() > 0; };
          const std::array all{info, objects, classes, labels, labels_info, picture};
          if (std::none_of(all.begin(), all.end(), is_heard)) return camera->skip();
          LabelImage image = camera->next();
          image.stamp_ns += simulation.clock.start_ns();
          labels_info.publish(labels_info_to_msg(image, block_px, frame));
          info.publish(camera_info_to_msg(image.width, image.height, image.focal_length_px, image.stamp_ns, frame));
          if (is_heard(labels)) {
            std::vector<bool> is_class;
            for (const std::string& name : camera->class_names()) is_class.push_back(name.rfind(wanted, 0) == 0);
            labels.publish(soft_labels_to_msg(image, is_class, block_px, frame));
          }
          if (is_heard(objects)) objects.publish(objects_image_to_msg(image, frame));
          if (is_heard(classes)) classes.publish(classes_image_to_msg(image, frame));
          if (is_heard(picture)) {
            picture.publish(picture_to_msg({image.width, image.height, image.rgb}, image.stamp_ns, frame));
          }
        });
  }

  double later(double delay_s) const { return simulation_.params.is_led() ? delay_s : 0.0; }

  /// The frame of a sensor; adds its mounting to those in TF.
  template <class Mounted>
  std::string mount(const Mounted& mounted) {
    const SimulatorParams& params = simulation_.params;
    const std::string frame = mounted.name == "lidar" ? params.lidar_frame : prefix_ + mounted.name;
    mounts_.push_back(
        transform_to_msg(mounted.T_robot_sensor, simulation_.clock.start_ns(), params.robot_frame, frame));
    return frame;
  }

  Simulation& simulation_;
  SimulatedVehicle& vehicle_;
  const std::string prefix_;  ///< the name of the robot, before frames of its own
  SensorNames names_;
  SensorTopics topics_;
  std::vector<geometry_msgs::TransformStamped> mounts_;
};

}  // namespace

SensorTopics add_sensors(Simulation& simulation, SimulatedVehicle& vehicle) {
  return SensorPublishers(simulation, vehicle).add_all();
}

}  // namespace situation_awareness

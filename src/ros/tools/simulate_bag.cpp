// SPDX-License-Identifier: BSD-3-Clause
// From a simulated world to a bag, without a roscore; makes the stored flights of test/golden.
#include <cmath>
#include <cstdint>
#include <memory>
#include <stdexcept>
#include <string>
#include <utility>

#include <ros/message_traits.h>
#include <rosbag/bag.h>
#include <tf2_msgs/TFMessage.h>
#include <boost/make_shared.hpp>

#include "command_line.hpp"
#include "situation_awareness/common/time.hpp"
#include "situation_awareness/geometry/angles.hpp"
#include "situation_awareness/ros/convert/cloud.hpp"
#include "situation_awareness/ros/convert/images.hpp"
#include "situation_awareness/ros/convert/poses.hpp"
#include "situation_awareness/ros/convert/scan.hpp"
#include "situation_awareness/ros/convert/time.hpp"
#include "situation_awareness/ros/motion_sensors.hpp"
#include "situation_awareness/ros/params/package.hpp"
#include "situation_awareness/ros/simulation.hpp"
#include "situation_awareness/sim/label_camera.hpp"
#include "situation_awareness/sim/ring_scanner.hpp"
#include "situation_awareness/sim/scan_simulation.hpp"
#include "situation_awareness/sim/scanner_presets.hpp"
#include "situation_awareness/sim/schedule.hpp"
#include "situation_awareness/sim/sensors.hpp"
#include "situation_awareness/sim/world.hpp"

namespace situation_awareness {
namespace {

constexpr const char* kDescription =
    R"(Flies a world and records /scan and /tf (world to lidar, at the first and the last beam of each scan), or with
--rings /points in place of /scan; besides /imu, /fix, /wheel_odometry and /label_camera/... of what the world's file
asks for, with /tf_static (lidar to these sensors). Lengths are whole millimetres, as scanners give them, or with
--scanner what that scanner gives. The bag is compressed.
)";

constexpr double kFieldOfView_deg = 270.0;

struct Options {
  std::string world, out, scanner;
  double duration_s = 10.0, resolution_deg = 0.25;
  std::uint64_t seed = 1;
  int rings = 0;
  SimulatedScannerParams lidar;
};

/// The file of a scanner's preset: a path as it is, a name as that of a preset of this package.
std::string scanner_file(const std::string& scanner) {
  if (is_scanner_preset_path(scanner)) return scanner;
  return scanner_preset_file(scanner, package_folder() + "/models/scanners");
}

void add_options(CommandLine& app, Options& options) {
  app.add_option("--world", options.world, "the world (models/worlds/README.md)").required().type_name("FILE");
  app.add_option("--out", options.out, "the bag").required().type_name("FILE");
  app.add_option("--duration", options.duration_s, "length of the flight").type_name("S").check(from_to(1e-3, 1e6));
  app.add_option("--seed", options.seed, "of the ranges' noise").type_name("N").check(from_to(0.0, 1e9));
  app.add_option("--rate", options.lidar.rate_hz, "scans per second").type_name("HZ").check(from_to(0.1, 1000.0));
  app.add_option("--resolution-deg", options.resolution_deg, "from beam to beam, over 270 degrees; negative: clockwise")
      .type_name("D")
      .check(from_to(0.01, 90.0) | from_to(-90.0, -0.01));
  app.add_option("--rings", options.rings,
                 "a ring scanner of so many rings from -15 to 15 degrees,\nover 360 degrees; 0: a 2D scanner")
      .type_name("N")
      .check(from_to(0.0, 256.0));
  app.add_option("--sweep-s", options.lidar.sweep_s,
                 "time from the first beam of a scan to the last;\n0: all at one instant")
      .type_name("S")
      .check(from_to(0.0, 1.0));
  app.add_option("--scanner", options.scanner,
                 "a preset of models/scanners, such as utm_30lx, or a YAML\nfile; --rate and --sweep-s have precedence")
      .type_name("NAME|FILE")
      .excludes("--resolution-deg")
      .excludes("--rings");
  app.callback([&app, &options] {
    SimulatedScannerParams& lidar = options.lidar;
    if (!options.scanner.empty()) {
      const SimulatedScannerParams given = lidar;
      lidar = load_scanner_preset(scanner_file(options.scanner));
      if (app.count("--rate") > 0) lidar.rate_hz = given.rate_hz;
      if (app.count("--sweep-s") > 0) lidar.sweep_s = given.sweep_s;
      return;
    }
    lidar.beams = 1 + static_cast<int>(kFieldOfView_deg / std::abs(options.resolution_deg) + 1e-9);
    lidar.angle_increment_rad = radians(options.resolution_deg);
    lidar.angle_min_rad = std::copysign(radians(kFieldOfView_deg / 2.0), -options.resolution_deg);
  });
}

float whole_millimetres(float length_m) { return std::round(length_m * 1000.0F) / 1000.0F; }

void record(const Options& options, SimulatedScan simulated, rosbag::Bag& bag) {
  const SimulatedScannerParams& lidar = options.lidar;
  simulated.scan.stamp_ns += kSimulationStart_ns;
  if (options.scanner.empty()) {
    for (Beam& beam : simulated.scan.beams) beam.range_m = whole_millimetres(beam.range_m);
  }
  const ros::Time stamp = to_ros_time(simulated.scan.stamp_ns);
  const sensor_msgs::LaserScan scan =
      scan_to_msg(simulated.scan, "lidar", lidar.range_min_m, lidar.range_max_m, 1.0 / lidar.rate_hz);
  tf2_msgs::TFMessage tf;
  tf.transforms.push_back(transform_to_msg(simulated.T_world_lidar, simulated.scan.stamp_ns, "world", "lidar"));
  if (simulated.scan.time_increment_s > 0.0) {
    tf.transforms.push_back(
        transform_to_msg(simulated.T_world_lidar_end, to_nanoseconds(time_of_last_beam(scan)), "world", "lidar"));
  }
  bag.write("/tf", stamp, tf);
  bag.write("/scan", stamp, scan);
}

/// Lets `schedule` record what the 2D scanner measures. Returns the scanner's world.
const World& add_scanner(const Options& options, Schedule& schedule, rosbag::Bag& bag) {
  const auto simulation = std::make_shared<ScanSimulation>(options.world, options.lidar, options.seed);
  const auto scans = std::make_shared<int>(0);
  schedule.add([scans, &options] { return *scans / options.lidar.rate_hz; },
               [simulation, scans, &options, &bag] {
                 ++*scans;
                 record(options, simulation->next(), bag);
               });
  return simulation->world();
}

SimulatedRingScannerParams ring_scanner_of(const Options& options) {
  SimulatedRingScannerParams params;
  params.rings = options.rings;
  params.columns = static_cast<int>(360.0 / std::abs(options.resolution_deg) + 1e-9);
  params.azimuth_increment_rad = radians(options.resolution_deg);
  params.azimuth_min_rad = std::copysign(kPi, -options.resolution_deg);
  params.rate_hz = options.lidar.rate_hz;
  params.sweep_s = options.lidar.sweep_s;
  return params;
}

void record(const Options& options, RingScannerSample sample, rosbag::Bag& bag) {
  sample.cloud.stamp_ns += kSimulationStart_ns;
  for (CloudPoint& point : sample.cloud.points) {
    for (float* const length_m : {&point.x_m, &point.y_m, &point.z_m}) *length_m = whole_millimetres(*length_m);
  }
  const std::int64_t stamp_ns = sample.cloud.stamp_ns;
  tf2_msgs::TFMessage tf;
  tf.transforms.push_back(transform_to_msg(sample.T_world_sensor, stamp_ns, "world", "lidar"));
  if (options.lidar.sweep_s > 0.0) {
    const std::int64_t end_ns = stamp_ns + nanoseconds(options.lidar.sweep_s);
    tf.transforms.push_back(transform_to_msg(sample.T_world_sensor_end, end_ns, "world", "lidar"));
  }
  bag.write("/tf", to_ros_time(stamp_ns), tf);
  bag.write("/points", to_ros_time(stamp_ns), cloud_to_msg(sample.cloud, "lidar"));
}

/// Lets `schedule` record what the ring scanner measures. Returns the scanner's world.
const World& add_ring_scanner(const Options& options, Schedule& schedule, rosbag::Bag& bag) {
  const auto world = std::make_shared<World>(options.world);
  const auto scanner =
      std::make_shared<SimulatedRingScanner>(*world, world->T_robot_lidar(), ring_scanner_of(options), options.seed);
  schedule.add([scanner] { return scanner->next_time_s(); },
               [world, scanner, &options, &bag] { record(options, scanner->next(), bag); });
  return *world;
}

/// As a latched topic, so that who plays the bag and listens later gets it, too.
void write_static_transforms(const tf2_msgs::TFMessage& tf, rosbag::Bag& bag) {
  const auto header = boost::make_shared<ros::M_string>();
  (*header)["type"] = ros::message_traits::DataType<tf2_msgs::TFMessage>::value();
  (*header)["md5sum"] = ros::message_traits::MD5Sum<tf2_msgs::TFMessage>::value();
  (*header)["message_definition"] = ros::message_traits::Definition<tf2_msgs::TFMessage>::value();
  (*header)["latching"] = "1";
  bag.write("/tf_static", to_ros_time(kSimulationStart_ns), tf, header);
}

void record(LabelImage image, const std::string& topic, const std::string& frame, rosbag::Bag& bag) {
  image.stamp_ns += kSimulationStart_ns;
  const ros::Time stamp = to_ros_time(image.stamp_ns);
  bag.write(topic + "/camera_info", stamp,
            camera_info_to_msg(image.width, image.height, image.focal_length_px, image.stamp_ns, frame));
  bag.write(topic + "/objects", stamp, objects_image_to_msg(image, frame));
  bag.write(topic + "/classes", stamp, classes_image_to_msg(image, frame));
  if (image.rgb.empty()) return;
  bag.write(topic + "/image", stamp, picture_to_msg({image.width, image.height, image.rgb}, image.stamp_ns, frame));
}

/// Lets `schedule` record the sensors of the world's file besides scanners, which are fixed to the lidar.
void record_sensors(const World& world, std::uint64_t seed, Schedule& schedule, rosbag::Bag& bag) {
  const WorldSensors sensors = sensors_of(world);
  SensorNames names;
  tf2_msgs::TFMessage mounts;
  const auto mount = [&, T_lidar_robot = world.T_robot_lidar().inverse()](const auto& mounted) {
    mounts.transforms.push_back(
        transform_to_msg(T_lidar_robot * mounted.T_robot_sensor, kSimulationStart_ns, "lidar", mounted.name));
  };
  add_motion_sensors(world, sensors, seed, "", names,
                     [&](const auto& mounted, auto sensor, const std::string& topic, const auto& to_msg) {
                       mount(mounted);
                       const auto shared = std::make_shared<decltype(sensor)>(std::move(sensor));
                       schedule.add([shared] { return shared->next_time_s(); },
                                    [shared, topic, to_msg, &bag] {
                                      auto sample = shared->next();
                                      sample.stamp_ns += kSimulationStart_ns;
                                      bag.write("/" + topic, to_ros_time(sample.stamp_ns), to_msg(sample));
                                    });
                     });
  for (const auto& mounted : sensors.label_cameras) {
    mount(mounted);
    const auto camera = std::make_shared<SimulatedLabelCamera>(world, mounted.T_robot_sensor, mounted.params);
    const std::string topic = "/" + names.of(mounted.name, "label_camera");
    schedule.add([camera] { return camera->next_time_s(); },
                 [camera, topic, frame = mounted.name, &bag] { record(camera->next(), topic, frame, bag); });
  }
  if (!mounts.transforms.empty()) write_static_transforms(mounts, bag);
}

void simulate_bag(const Options& options) {
  const auto scans = static_cast<double>(std::lround(options.duration_s * options.lidar.rate_hz));
  if (scans < 1.0)
    throw std::runtime_error("a flight so short has no scan: --duration is less than half a period of --rate");
  rosbag::Bag bag(options.out, rosbag::bagmode::Write);
  bag.setCompression(rosbag::compression::BZ2);
  Schedule schedule;
  const World& world =
      options.rings > 0 ? add_ring_scanner(options, schedule, bag) : add_scanner(options, schedule, bag);
  record_sensors(world, options.seed, schedule, bag);
  while (schedule.next_time_s() < scans / options.lidar.rate_hz) schedule.step();
  bag.close();
}

}  // namespace
}  // namespace situation_awareness

int main(int argc, char** argv) {
  using namespace situation_awareness;
  Options options;
  CommandLine app("simulate_bag", kDescription);
  add_options(app, options);
  return run_program(app, argc, argv, [&options] {
    simulate_bag(options);
    return 0;
  });
}

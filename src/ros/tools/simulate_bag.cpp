// SPDX-License-Identifier: BSD-3-Clause
// From a simulated world to a bag, without a roscore: the stored flights of test/golden are made by it.
#include <cmath>
#include <cstdio>
#include <stdexcept>
#include <string>

#include <rosbag/bag.h>
#include <tf2_msgs/TFMessage.h>

#include "options.hpp"
#include "situation_awareness/common/time.hpp"
#include "situation_awareness/geometry/angles.hpp"
#include "situation_awareness/ros/convert/cloud.hpp"
#include "situation_awareness/ros/convert/poses.hpp"
#include "situation_awareness/ros/convert/scan.hpp"
#include "situation_awareness/ros/convert/time.hpp"
#include "situation_awareness/sim/ring_scanner.hpp"
#include "situation_awareness/sim/scan_simulation.hpp"
#include "situation_awareness/sim/world.hpp"

namespace situation_awareness {
namespace {

constexpr const char* kUsage =
    "usage: simulate_bag --world FILE.xml --out FILE.bag [options]\n"
    "\n"
    "Flies a world and records /scan and /tf (world to lidar, at the first and the last beam of each scan), or with\n"
    "--rings /points in the place of /scan. Lengths are whole millimetres, as scanners give them, and the bag is\n"
    "compressed.\n"
    "\n"
    "  --world FILE          the world (models/worlds/README.md)\n"
    "  --out FILE            the bag\n"
    "  --duration S          length of the flight (default 10)\n"
    "  --seed N              of the ranges' noise (default 1)\n"
    "  --rate HZ             scans per second (default 20)\n"
    "  --resolution-deg D    from beam to beam, over 270 degrees; negative: clockwise (default 0.25)\n"
    "  --rings N             a ring scanner of so many rings from -15 to 15 degrees, over 360 degrees\n"
    "  --sweep-s S           time from the first beam of a scan to the last (default 0: all at one instant)\n"
    "  --help                this text\n";

constexpr double kFieldOfView_deg = 270.0;
constexpr std::int64_t kStart_ns = 1000 * kNanosecondsPerSecond;  // to ROS a time of zero means "not started"

struct Arguments {
  std::string world, out;
  double duration_s = 10.0, seed = 1.0, resolution_deg = 0.25, rings = 0.0;
  SimulatedScannerParams lidar;
  bool help = false;
};

TakeValue number_into(double& place) {
  return [&place](const std::string& option, const std::string& text) {
    place = number_of(text);
    if (!std::isfinite(place)) throw UsageError(option + " needs a number, not " + text);
  };
}

Arguments parse_arguments(int argc, char** argv) {
  Arguments arguments;
  arguments.help = read_options(argc, argv,
                                {{"--world", into(arguments.world)},
                                 {"--out", into(arguments.out)},
                                 {"--duration", number_into(arguments.duration_s)},
                                 {"--seed", number_into(arguments.seed)},
                                 {"--rate", number_into(arguments.lidar.rate_hz)},
                                 {"--resolution-deg", number_into(arguments.resolution_deg)},
                                 {"--rings", number_into(arguments.rings)},
                                 {"--sweep-s", number_into(arguments.lidar.sweep_s)}});
  if (arguments.help) return arguments;
  require("--world", arguments.world);
  require("--out", arguments.out);
  if (!(arguments.duration_s > 0.0)) throw UsageError("--duration must be more than 0");
  if (!(arguments.seed >= 0.0 && arguments.seed < 1e9)) throw UsageError("--seed must be in [0, 1e9)");
  if (!(std::abs(arguments.resolution_deg) >= 0.01 && std::abs(arguments.resolution_deg) <= 90.0)) {
    throw UsageError("--resolution-deg must be in [0.01, 90], or the same below zero");
  }
  if (arguments.rings != std::floor(arguments.rings)) throw UsageError("--rings must be a whole number");
  SimulatedScannerParams& lidar = arguments.lidar;
  lidar.beams = 1 + static_cast<int>(kFieldOfView_deg / std::abs(arguments.resolution_deg) + 1e-9);
  lidar.angle_increment_rad = radians(arguments.resolution_deg);
  lidar.angle_min_rad = std::copysign(radians(kFieldOfView_deg / 2.0), -arguments.resolution_deg);
  return arguments;
}

float whole_millimetres(float length_m) { return std::round(length_m * 1000.0F) / 1000.0F; }

void record_scans(const Arguments& arguments, int scans, rosbag::Bag& bag) {
  const SimulatedScannerParams& lidar = arguments.lidar;
  ScanSimulation world(arguments.world, lidar, static_cast<std::uint64_t>(arguments.seed));
  for (int i = 0; i < scans; ++i) {
    SimulatedScan simulated = world.next();
    simulated.scan.stamp_ns += kStart_ns;
    for (Beam& beam : simulated.scan.beams) beam.range_m = whole_millimetres(beam.range_m);
    const ros::Time stamp = to_ros_time(simulated.scan.stamp_ns);
    const sensor_msgs::LaserScan scan =
        scan_to_msg(simulated.scan, "lidar", lidar.range_min_m, lidar.range_max_m, 1.0 / lidar.rate_hz);
    tf2_msgs::TFMessage tf;
    tf.transforms.push_back(transform_to_msg(simulated.T_world_lidar, simulated.scan.stamp_ns, "world", "lidar"));
    if (lidar.sweep_s > 0.0) {
      tf.transforms.push_back(
          transform_to_msg(simulated.T_world_lidar_end, to_nanoseconds(time_of_last_beam(scan)), "world", "lidar"));
    }
    bag.write("/tf", stamp, tf);
    bag.write("/scan", stamp, scan);
  }
}

SimulatedRingScannerParams ring_scanner_of(const Arguments& arguments) {
  SimulatedRingScannerParams params;
  params.rings = static_cast<int>(arguments.rings);
  params.columns = static_cast<int>(360.0 / std::abs(arguments.resolution_deg) + 1e-9);
  params.azimuth_increment_rad = radians(arguments.resolution_deg);
  params.azimuth_min_rad = std::copysign(kPi, -arguments.resolution_deg);
  params.rate_hz = arguments.lidar.rate_hz;
  params.sweep_s = arguments.lidar.sweep_s;
  return params;
}

void record_clouds(const Arguments& arguments, int clouds, rosbag::Bag& bag) {
  World world(arguments.world);
  SimulatedRingScanner scanner(world, world.T_robot_lidar(), ring_scanner_of(arguments),
                               static_cast<std::uint64_t>(arguments.seed));
  for (int i = 0; i < clouds; ++i) {
    RingScannerSample sample = scanner.next();
    sample.cloud.stamp_ns += kStart_ns;
    for (CloudPoint& point : sample.cloud.points) {
      for (float* const length_m : {&point.x_m, &point.y_m, &point.z_m}) *length_m = whole_millimetres(*length_m);
    }
    const std::int64_t stamp_ns = sample.cloud.stamp_ns;
    tf2_msgs::TFMessage tf;
    tf.transforms.push_back(transform_to_msg(sample.T_world_sensor, stamp_ns, "world", "lidar"));
    if (scanner.params().sweep_s > 0.0) {
      const std::int64_t end_ns = stamp_ns + nanoseconds(scanner.params().sweep_s);
      tf.transforms.push_back(transform_to_msg(sample.T_world_sensor_end, end_ns, "world", "lidar"));
    }
    bag.write("/tf", to_ros_time(stamp_ns), tf);
    bag.write("/points", to_ros_time(stamp_ns), cloud_to_msg(sample.cloud, "lidar"));
  }
}

void simulate_bag(const Arguments& arguments) {
  rosbag::Bag bag(arguments.out, rosbag::bagmode::Write);
  bag.setCompression(rosbag::compression::BZ2);
  const auto scans = static_cast<int>(std::lround(arguments.duration_s * arguments.lidar.rate_hz));
  if (arguments.rings > 0.0) {
    record_clouds(arguments, scans, bag);
  } else {
    record_scans(arguments, scans, bag);
  }
  bag.close();
}

}  // namespace
}  // namespace situation_awareness

int main(int argc, char** argv) {
  using namespace situation_awareness;
  return run_program("simulate_bag", kUsage, argc, argv, parse_arguments, [](const Arguments& arguments) {
    simulate_bag(arguments);
    return 0;
  });
}

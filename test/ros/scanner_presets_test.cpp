// SPDX-License-Identifier: BSD-3-Clause
// Scanners by preset, as simulate_bag records them.
#include <cmath>
#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <string>
#include <vector>

#include <gtest/gtest.h>
#include <rosbag/bag.h>
#include <rosbag/view.h>
#include <sensor_msgs/LaserScan.h>
#include <sys/wait.h>

#include "situation_awareness/common/time.hpp"
#include "situation_awareness/ros/convert/scan.hpp"
#include "situation_awareness/ros/convert/time.hpp"
#include "situation_awareness/ros/simulation.hpp"
#include "situation_awareness/sim/scan_simulation.hpp"
#include "situation_awareness/sim/scanner_presets.hpp"

namespace situation_awareness::scanner_presets_test {
namespace {

// Where the package is.
const std::string kEnvironment = std::string("ROS_PACKAGE_PATH=") + SITUATION_AWARENESS_SOURCE_DIR + " ";
const std::string kModels = std::string(SITUATION_AWARENESS_SOURCE_DIR) + "/models";
const std::string kWorldFile = kModels + "/worlds/demo.xml";

std::string in_temporary_folder(const std::string& name) {
  return (std::filesystem::path(testing::TempDir()) / name).string();
}

/// The exit status of simulate_bag.
int simulate_bag(const std::string& options) {
  const int status =
      std::system((kEnvironment + SIMULATE_BAG + " --world " + kWorldFile + " --duration 1 --seed 3 --out " +
                   in_temporary_folder("scanner_presets_test.bag") + " " + options + " 2>/dev/null")
                      .c_str());
  return WIFEXITED(status) ? WEXITSTATUS(status) : -1;
}

std::vector<sensor_msgs::LaserScan> recorded_scans() {
  const rosbag::Bag bag(in_temporary_folder("scanner_presets_test.bag"), rosbag::bagmode::Read);
  std::vector<sensor_msgs::LaserScan> scans;
  rosbag::View view(bag, rosbag::TopicQuery("/scan"));
  for (const rosbag::MessageInstance& instance : view) scans.push_back(*instance.instantiate<sensor_msgs::LaserScan>());
  return scans;
}

TEST(SimulateBag, RecordsTheScannerOfAFileAsItIs) {
  const std::string file = in_temporary_folder("scanner_presets_test.yaml");
  std::ofstream(file) << "beams: 360\nangle_min_rad: -3.14\nangle_increment_rad: 0.0174\nrate_hz: 10\nsweep_s: 0.07\n"
                         "sweep_against_order: 1\nstamp_error_s: 0.02\ntime_increment_scale: 0.5\n"
                         "range_quantum_m: 0.00025\n";
  const SimulatedScannerParams params = load_scanner_preset(file);
  ASSERT_EQ(simulate_bag("--scanner " + file), 0);
  const std::vector<sensor_msgs::LaserScan> scans = recorded_scans();
  ASSERT_EQ(scans.size(), 10U);
  ScanSimulation simulation(kWorldFile, params, 3);
  bool has_parts_of_millimetres = false;
  for (const sensor_msgs::LaserScan& msg : scans) {
    Scan scan = simulation.next().scan;
    scan.stamp_ns += kSimulationStart_ns;
    EXPECT_EQ(msg, scan_to_msg(scan, "lidar", params.range_min_m, params.range_max_m, 0.1));
    for (const float range_m : msg.ranges) {
      const double millimetres = 1e3 * range_m;
      has_parts_of_millimetres |= std::isfinite(range_m) && std::abs(millimetres - std::round(millimetres)) > 0.2;
    }
  }
  EXPECT_TRUE(has_parts_of_millimetres);
}

TEST(SimulateBag, RecordsAShippedScannerByName) {
  ASSERT_EQ(simulate_bag("--scanner lms100 --rate 20"), 0);
  const std::vector<sensor_msgs::LaserScan> scans = recorded_scans();
  ASSERT_EQ(scans.size(), 20U);
  EXPECT_EQ(scans.front().ranges.size(), 541U);
  EXPECT_NEAR(scans.front().angle_max, 0.75 * M_PI, 1e-5);
}

TEST(SimulateBag, RefusesWhatTheScannerOfAPresetHasAlready) {
  const std::string preset = "--scanner " + kModels + "/scanners/lms100.yaml ";
  EXPECT_EQ(simulate_bag(preset + "--rings 16"), 2);
  EXPECT_EQ(simulate_bag(preset + "--resolution-deg 1"), 2);
  EXPECT_EQ(simulate_bag("--scanner " + kModels + "/scanners/none.yaml"), 1);
}

}  // namespace
}  // namespace situation_awareness::scanner_presets_test

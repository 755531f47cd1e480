// SPDX-License-Identifier: BSD-3-Clause
#include "situation_awareness/sim/scanner_presets.hpp"

#include <cmath>
#include <filesystem>
#include <set>
#include <sstream>
#include <string>
#include <vector>

#include <gtest/gtest.h>

#include "sim/world_file.hpp"
#include "situation_awareness/geometry/angles.hpp"
#include "situation_awareness/sim/scan_simulation.hpp"

namespace situation_awareness::scanner_presets_test {
namespace {

const std::string kScanners = std::string(SITUATION_AWARENESS_SOURCE_DIR) + "/models/scanners";

SimulatedScannerParams shipped(const std::string& name) {
  return load_scanner_preset(scanner_preset_file(name, kScanners));
}

std::set<std::string> shipped_names() {
  std::set<std::string> names;
  for (const auto& file : std::filesystem::directory_iterator(kScanners)) names.insert(file.path().stem().string());
  return names;
}

TEST(ScannerPresets, AreThoseOfTheDocumentation) {
  EXPECT_EQ(shipped_names(),
            (std::set<std::string>{"lms100", "rplidar_a2", "rplidar_a3", "s300", "ust_10lx", "utm_30lx"}));
}

TEST(ScannerPresets, EachFigureHasASource) {
  for (const std::string& name : shipped_names()) {
    std::istringstream text(text_of_file(kScanners + "/" + name + ".yaml"));
    for (std::string line; std::getline(text, line);) {
      if (line.empty() || line[0] == '#') continue;
      EXPECT_NE(line.find("  # "), std::string::npos) << name << ": " << line;
    }
  }
}

TEST(ScannerPresets, ScanAWorld) {
  for (const std::string& name : shipped_names()) {
    const SimulatedScannerParams params = shipped(name);
    ScanSimulation simulation(kWorlds + "demo.xml", params, 1);
    const Scan scan = simulation.next().scan;
    double hits = 0.0;
    for (const Beam& beam : scan.beams) hits += beam.state == BeamState::kHit ? 1.0 : 0.0;
    EXPECT_GT(hits, 0.5 * static_cast<double>(scan.beams.size())) << name << ", in a closed room";
  }
}

/// Of the beams within 3 deg of the normal of a wall at a distance, in 400 scans.
struct OnWall {
  double n = 0.0, missing = 0.0, mean_m = 0.0, sigma_m = 0.0;
};

OnWall on_wall(const SimulatedScannerParams& params, double distance_m) {
  const WorldFile file(world_text(kRobot + "<geom type=\"box\" size=\"0.5 40 2\" pos=\"" +
                                  std::to_string(distance_m + 0.5) + " 0 1.5\"/>"));
  World world(file.path());
  SimulatedScanner scanner(world, world.T_robot_lidar(), params, 1);
  OnWall result;
  double sum_m = 0.0, sum_of_squares_m2 = 0.0;
  for (int s = 0; s < 400; ++s) {
    const Scan scan = scanner.next().scan;
    for (std::size_t i = 0; i < scan.beams.size(); ++i) {
      const double angle = scan.angle_min_rad + static_cast<double>(i) * scan.angle_increment_rad;
      if (std::abs(angle) > radians(3.01)) continue;
      result.n += 1.0;
      if (scan.beams[i].state != BeamState::kHit) {
        result.missing += 1.0;
        continue;
      }
      const double across_m = scan.beams[i].range_m * std::cos(angle);
      sum_m += across_m;
      sum_of_squares_m2 += across_m * across_m;
    }
  }
  const double hits = result.n - result.missing;
  result.mean_m = sum_m / hits;
  result.sigma_m = std::sqrt(sum_of_squares_m2 / hits - result.mean_m * result.mean_m);
  return result;
}

TEST(ScannerPresets, TheRPLidarErrsAsTheRecordedOne) {
  struct Measured {
    double distance_m, sigma_low_m, sigma_high_m;
  };
  for (const Measured& measured :
       {Measured{1.0, 0.004, 0.005}, {2.0, 0.008, 0.011}, {4.0, 0.010, 0.015}, {6.0, 0.016, 0.022}}) {
    const OnWall wall = on_wall(shipped("rplidar_a2"), measured.distance_m);
    EXPECT_GT(wall.sigma_m, 0.95 * measured.sigma_low_m) << measured.distance_m;
    EXPECT_LT(wall.sigma_m, 1.05 * measured.sigma_high_m) << measured.distance_m;
    EXPECT_NEAR(wall.mean_m * (1.005 + 0.007 * wall.mean_m), measured.distance_m, 0.005);
    EXPECT_GT(wall.missing, 0.16 * wall.n);
    EXPECT_LT(wall.missing, 0.25 * wall.n);
  }
}

TEST(ScannerPresets, NoiseIsWithinTheDatasheets) {
  EXPECT_LT(on_wall(shipped("utm_30lx"), 2.0).sigma_m, 0.010);
  EXPECT_LT(on_wall(shipped("utm_30lx"), 9.0).sigma_m, 0.0103);
  EXPECT_LT(on_wall(shipped("utm_30lx"), 25.0).sigma_m, 0.030);
  EXPECT_LT(on_wall(shipped("ust_10lx"), 9.0).sigma_m, 0.030);
  EXPECT_NEAR(on_wall(shipped("lms100"), 9.0).sigma_m, 0.012, 0.001);
}

TEST(ScannerPresets, ANameIsInTheFolderAndAPathIsItself) {
  EXPECT_EQ(scanner_preset_file("s300", "models/scanners"), "models/scanners/s300.yaml");
  EXPECT_EQ(scanner_preset_file("mine.yaml", "models/scanners"), "mine.yaml");
  EXPECT_EQ(scanner_preset_file("/tmp/mine", "models/scanners"), "/tmp/mine");
}

TEST(ScannerPresets, OmittedParametersKeepTheirDefaults) {
  const WorldFile file("range_quantum_m: 0.002\n");
  SimulatedScannerParams expected;
  expected.errors.range_quantum_m = 0.002;
  const SimulatedScannerParams params = load_scanner_preset(file.path());
  EXPECT_EQ(params.errors.range_quantum_m, 0.002);
  EXPECT_EQ(params.beams, expected.beams);
  EXPECT_EQ(params.range_sigma_m, expected.range_sigma_m);
}

TEST(ScannerPresets, BadOnesAreRefusedNamingFileFieldAndBound) {
  const auto expect_refused = [](const std::string& text, std::vector<std::string> facts) {
    const WorldFile file(text);
    facts.push_back(file.path());
    EXPECT_TRUE(names(refusal_of([&] { load_scanner_preset(file.path()); }), facts));
  };
  expect_refused("missing_fraction: 2\n", {"missing_fraction", "2", "0", "1"});
  expect_refused("rate_hz: fast\n", {"rate_hz", "fast", "0.1", "1000"});
  expect_refused("beams: 1\n", {"beams", "1", "2", "1e+05"});
  expect_refused("missing_part: 0.1\n", {"missing_part", "missing_fraction"});
  expect_refused("sweep_s: 0.5\n", {"scanner.sweep_s", "scanner.rate_hz"});
  expect_refused("range_max_m: 0.05\n", {"scanner.range_max_m", "scanner.range_min_m"});
  EXPECT_TRUE(names(refusal_of([] { shipped("none"); }), {kScanners + "/none.yaml"}));
}

}  // namespace
}  // namespace situation_awareness::scanner_presets_test

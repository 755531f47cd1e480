// SPDX-License-Identifier: BSD-3-Clause
#include "situation_awareness/sim/sensors.hpp"

#include <filesystem>
#include <fstream>
#include <set>
#include <stdexcept>
#include <string>

#include <gtest/gtest.h>

#include "sim/world_file.hpp"

namespace situation_awareness::sensors_test {
namespace {

std::string robot_with(const std::string& sites) {
  return "<body name=\"robot\" mocap=\"true\" pos=\"1 2 1.5\" euler=\"0 0 0.3\">" + sites + "</body>";
}

WorldSensors sensors_in(const std::string& sites, const std::string& texts) {
  const WorldFile file(world_text(robot_with(sites), texts));
  return sensors_of(World(file.path()));
}

/// The error message on reading the sensors, after the file's name.
std::string sensor_error(const std::string& sites, const std::string& texts) {
  const WorldFile file(world_text(robot_with(sites), texts));
  try {
    sensors_of(World(file.path()));
  } catch (const std::runtime_error& error) {
    const std::string what = error.what();
    EXPECT_EQ(what.find(file.path() + ": "), 0U) << what;
    return what.substr(file.path().size() + 2);
  }
  return "no error";
}

TEST(Sensors, ASiteLidarIsAScannerConfiguredByItsText) {
  const WorldSensors plain = sensors_in("<site name=\"lidar\" pos=\"0.1 0 0.2\" euler=\"0 0 0.5\"/>", "");
  ASSERT_EQ(plain.scanners.size(), 1U);
  EXPECT_EQ(plain.scanners[0].name, "lidar");
  EXPECT_EQ(plain.scanners[0].params.beams, SimulatedScannerParams{}.beams);
  Eigen::Isometry3d T(Eigen::AngleAxisd(0.5, Eigen::Vector3d::UnitZ()));
  T.translation() << 0.1, 0.0, 0.2;
  EXPECT_TRUE(plain.scanners[0].T_robot_sensor.isApprox(T, 1e-12));

  const WorldSensors two = sensors_in("<site name=\"lidar\"/><site name=\"mark\"/><site name=\"rear\"/>",
                                      R"(<text name="rear" data="scanner"/>
         <text name="lidar" data="scanner beams 541 angle_increment_rad 0.00872664626 rate_hz 25 range_sigma_m .012"/>)");
  ASSERT_EQ(two.scanners.size(), 2U);
  EXPECT_EQ(two.scanners[0].name, "lidar");
  EXPECT_EQ(two.scanners[0].params.beams, 541);
  EXPECT_EQ(two.scanners[0].params.rate_hz, 25.0);
  EXPECT_EQ(two.scanners[0].params.range_sigma_m, 0.012);
  EXPECT_EQ(two.scanners[0].params.range_max_m, SimulatedScannerParams{}.range_max_m);
  EXPECT_EQ(two.scanners[1].name, "rear");
}

TEST(Sensors, AScannerMayHaveAPreset) {
  const WorldFile preset("beams: 541\nangle_increment_rad: 0.00872664626\nrange_quantum_m: 0.01\nrate_hz: 12.5\n");
  const std::string path = preset.path() + ".yaml";
  std::filesystem::copy_file(preset.path(), path);
  const WorldSensors sensors =
      sensors_in("<site name=\"lidar\"/><site name=\"rear\"/>", "<text name=\"lidar\" data=\"scanner preset " + path +
                                                                    " rate_hz 15 missing_fraction 0.1\"/>" +
                                                                    "<text name=\"rear\" data=\"scanner\"/>");
  std::filesystem::remove(path);
  ASSERT_EQ(sensors.scanners.size(), 2U);
  EXPECT_EQ(sensors.scanners[0].params.beams, 541);
  EXPECT_EQ(sensors.scanners[0].params.errors.range_quantum_m, 0.01);
  EXPECT_EQ(sensors.scanners[0].params.rate_hz, 15.0) << "the text has precedence";
  EXPECT_EQ(sensors.scanners[0].params.errors.missing_fraction, 0.1);
  EXPECT_EQ(sensors.scanners[1].params.beams, SimulatedScannerParams{}.beams);
}

/// A folder of worlds, with a folder of scanners beside it.
TEST(Sensors, APresetByNameIsBesideTheFolderOfTheWorld) {
  const std::filesystem::path folder = std::filesystem::path(testing::TempDir()) / "sensors_test";
  std::filesystem::create_directories(folder / "worlds");
  std::filesystem::create_directories(folder / "scanners");
  std::ofstream(folder / "scanners" / "mine.yaml") << "beams: 33\n";
  std::ofstream(folder / "worlds" / "world.xml")
      << world_text(robot_with("<site name=\"lidar\"/>"), "<text name=\"lidar\" data=\"scanner preset mine\"/>");
  const WorldSensors sensors = sensors_of(World((folder / "worlds" / "world.xml").string()));
  std::filesystem::remove_all(folder);
  ASSERT_EQ(sensors.scanners.size(), 1U);
  EXPECT_EQ(sensors.scanners[0].params.beams, 33);
}

TEST(Sensors, NameTheErrorInTheirText) {
  const std::string site = "<site name=\"eye\"/>";
  const auto error = [&](const std::string& text) {
    return sensor_error(site, "<text name=\"eye\" data=\"" + text + "\"/>");
  };
  EXPECT_EQ(error("scanner"), "no error");
  EXPECT_TRUE(names(error(" "), {"eye"}));
  EXPECT_TRUE(names(error("sonar"), {"eye", "sonar", "scanner"}));
  EXPECT_TRUE(names(error("scanner beams"), {"eye", "beams"}));
  EXPECT_TRUE(names(error("scanner beams many"), {"eye", "beams", "many"}));
  EXPECT_TRUE(names(error("scanner rate_hz nan"), {"eye", "rate_hz", "nan"}));
  EXPECT_TRUE(names(error("scanner beams 20.5"), {"eye", "beams", "whole"}));
  EXPECT_TRUE(names(error("scanner beams 20 beams 21"), {"eye", "beams"}));
  EXPECT_TRUE(names(error("scanner lasers 4"), {"eye", "lasers"}));
  EXPECT_TRUE(names(error("scanner preset"), {"eye", "preset"}));
  EXPECT_TRUE(names(error("scanner preset none"),
                    {"eye", "preset", (std::filesystem::temp_directory_path() / "../scanners/none.yaml").string()}));
  EXPECT_TRUE(names(error("imu preset none"), {"eye", "preset"}));
  const WorldFile spoiled("missing_fraction: 2\n");
  EXPECT_TRUE(
      names(error("scanner preset " + spoiled.path()), {"eye", spoiled.path(), "missing_fraction", "2", "0", "1"}));
  EXPECT_TRUE(names(error("scanner rate_hz 0"), {"eye", "scanner.rate_hz", "0", "0.1", "1000"}));
  EXPECT_TRUE(names(sensor_error(site, "<text name=\"ear\" data=\"scanner\"/>"), {"ear"}));
  EXPECT_TRUE(names(sensor_error("<site name=\"robot\"/>", "<text name=\"robot\" data=\"stand\"/>"),
                    {"robot", "body", "site"}));
}

TEST(Sensors, EachHasItsOwnSeed) {
  std::set<std::uint64_t> seeds;
  for (const char* name : {"lidar", "rear", "imu", "imu2", "fix", ""}) {
    for (std::uint64_t seed = 0; seed < 5; ++seed) {
      seeds.insert(seed_of_sensor(seed, name));
      EXPECT_EQ(seed_of_sensor(seed, name), seed_of_sensor(seed, std::string(name)));
    }
  }
  EXPECT_EQ(seeds.size(), 30U);
}

}  // namespace
}  // namespace situation_awareness::sensors_test

// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <sstream>
#include <stdexcept>
#include <string>
#include <vector>

#include <gtest/gtest.h>

#include "situation_awareness/sim/scan_simulation.hpp"
#include "support/refusal.hpp"

namespace situation_awareness {

inline const std::string kWorlds = std::string(SITUATION_AWARENESS_SOURCE_DIR) + "/models/worlds/";

/// A temporary world file.
class WorldFile {
 public:
  explicit WorldFile(const std::string& text) {
    std::string name = (std::filesystem::temp_directory_path() / "world_XXXXXX").string();
    const int descriptor = mkstemp(name.data());
    EXPECT_GE(descriptor, 0);
    FILE* const file = fdopen(descriptor, "w");
    std::fputs(text.c_str(), file);
    std::fclose(file);
    path_ = name;
  }
  ~WorldFile() { std::filesystem::remove(path_); }
  WorldFile(const WorldFile&) = delete;
  WorldFile& operator=(const WorldFile&) = delete;

  const std::string& path() const { return path_; }

 private:
  std::string path_;
};

/// `more` is for sections besides the custom one and that of the bodies.
inline std::string world_text(const std::string& bodies, const std::string& custom = "", const std::string& more = "") {
  return "<mujoco><compiler angle=\"radian\"/><custom>" + custom + "</custom>" + more + "<worldbody>" + bodies +
         "</worldbody></mujoco>";
}

/// A standing object.
inline std::string object_text(const std::string& name, const std::string& pose, const std::string& radii) {
  return "<body name=\"" + name + "\" " + pose + "><geom type=\"ellipsoid\" group=\"1\" size=\"" + radii +
         "\"/></body>";
}

inline std::string text_of_file(const std::string& path) {
  std::ostringstream text;
  text << std::ifstream(path).rdbuf();
  return text.str();
}

/// `text` with its only `from` replaced.
inline std::string replaced(std::string text, const std::string& from, const std::string& to) {
  const std::size_t place = text.find(from);
  EXPECT_NE(place, std::string::npos) << from;
  EXPECT_EQ(text.find(from, place + 1), std::string::npos) << from;
  return text.replace(place, from.size(), to);
}

/// The sections of the robot with motors, as included by worlds.
inline const std::string kQuadrotor = [] {
  std::string text = text_of_file(kWorlds + "parts/quadrotor.xml");
  text.erase(0, text.find("<mujocoinclude>") + 15);
  return text.erase(text.find("</mujocoinclude>"));
}();

/// The error message on loading a world of this text: one line that begins with the file.
inline std::string error_of(const std::string& text) {
  const WorldFile file(text);
  try {
    const ScanSimulation simulation(file.path(), {}, 0);
  } catch (const std::runtime_error& error) {
    const std::string what = error.what();
    EXPECT_EQ(what.find(file.path() + ": "), 0U) << what;
    EXPECT_EQ(what.find('\n'), std::string::npos) << what;
    return what;
  }
  return "no error";
}

/// A world of this text is refused in one line that begins with the file and has these facts: names, words, numbers.
inline void expect_error(const std::string& text, const std::vector<std::string>& facts) {
  EXPECT_TRUE(names(error_of(text), facts)) << text;
}

inline const std::string kRobot = R"(<body name="robot" mocap="true" pos="0 0 1.5"> <site name="lidar"/>
                                <geom group="2" size="0.2"/> </body>)";

/// A robot in fast flight, with a scanner mounted tilted and upside down, and two objects.
inline const std::string kBriskWorld = world_text(
    object_text("post", "pos=\"2.0 0.5 1\" euler=\"0 0 0.4\"", "0.3 0.15 1") +
        object_text("column", "pos=\"-3.0 -1.5 1\" euler=\"0 0 -1.1\"", "0.2 0.5 1") +
        R"(<body name="robot" mocap="true"> <site name="lidar" pos="0.1 -0.05 -0.2" euler="3.1 0.05 0.3"/> </body>)",
    R"(<text name="robot" data="loop speed 2.6 points 0 -2 1.5 0;  3 -2 1.7 1; 4 0.5 2.0 2; 2 2.2 1.6 3; -1 2 1.4 4;
                                 -1.5 0 1.5 5"/>
       <numeric name="robot_drag" data="0.3"/>)");

inline double tilt(const Eigen::Isometry3d& T_world_robot) { return std::acos(T_world_robot(2, 2)); }

}  // namespace situation_awareness

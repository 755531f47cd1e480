// SPDX-License-Identifier: BSD-3-Clause
#include "situation_awareness/ros/params/package.hpp"

#include <filesystem>
#include <stdexcept>

#include <ros/package.h>

namespace situation_awareness {

std::string package_folder() {
  const std::string by_ros = ros::package::getPath("situation_awareness");
  if (!by_ros.empty()) return by_ros;
  // lib/situation_awareness/PROGRAM -> share/situation_awareness, as installed
  std::error_code error;
  const std::filesystem::path program = std::filesystem::read_symlink("/proc/self/exe", error);
  const std::filesystem::path installed =
      program.parent_path().parent_path().parent_path() / "share" / "situation_awareness";
  if (!error && std::filesystem::exists(installed / "package.xml", error)) return installed.string();
  throw std::runtime_error("package situation_awareness is not in ROS_PACKAGE_PATH: source setup.bash first");
}

}  // namespace situation_awareness

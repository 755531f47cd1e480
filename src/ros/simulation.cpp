// SPDX-License-Identifier: BSD-3-Clause
#include "situation_awareness/ros/simulation.hpp"

#include <filesystem>

#include "situation_awareness/ros/params/package.hpp"

namespace situation_awareness {

std::string world_file(const std::string& world) {
  if (world.find('/') != std::string::npos || std::filesystem::path(world).extension() == ".xml") return world;
  return package_folder() + "/models/worlds/" + world + ".xml";
}

}  // namespace situation_awareness

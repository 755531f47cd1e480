// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <string>

#include "situation_awareness/map/objects/map_snapshot.hpp"

namespace situation_awareness {

// The map of objects in a file: see MapFile in map/map_file.hpp for each function and what it throws.

std::string map_to_yaml(const MapSnapshot& snapshot);
MapSnapshot map_from_yaml(const std::string& yaml, const std::string& source);
void save_map(const std::string& path, const MapSnapshot& snapshot);
MapSnapshot load_map(const std::string& path);
MapSnapshot load_map(const std::string& path, const std::string& world_frame);

}  // namespace situation_awareness

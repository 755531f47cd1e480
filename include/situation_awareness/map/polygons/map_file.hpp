// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <string>

#include "situation_awareness/map/polygons/map_snapshot.hpp"

namespace situation_awareness {

// The map of polygons in a file: see MapFile in map/map_file.hpp for each function and what it throws.

std::string polygon_map_to_yaml(const PolygonMapSnapshot& snapshot);
PolygonMapSnapshot polygon_map_from_yaml(const std::string& yaml, const std::string& source);
void save_polygon_map(const std::string& path, const PolygonMapSnapshot& snapshot);
PolygonMapSnapshot load_polygon_map(const std::string& path);
PolygonMapSnapshot load_polygon_map(const std::string& path, const std::string& world_frame);

}  // namespace situation_awareness

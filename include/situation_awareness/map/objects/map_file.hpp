// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <string>

#include "situation_awareness/map/objects/map_snapshot.hpp"

namespace situation_awareness {

// A map in a file that people can read (docs/map_file.md). Each number is written so that it reads back as the same one
// bit for bit. The last line has the SHA-256 of all before it, so that nothing cut off or damaged passes for a map.

/// Throws std::invalid_argument as MapSnapshot::validate, or if the world frame is not a name: what is written can be
/// read.
std::string map_to_yaml(const MapSnapshot& snapshot);

/// Throws std::invalid_argument with one sentence that names `source`, element and field if this is no whole map: see
/// MapSnapshot::validate; besides, every field is there once and no other.
MapSnapshot map_from_yaml(const std::string& yaml, const std::string& source);

/// Write the file, which is complete or not there: until it is, one of before stays as it was. Throws
/// std::invalid_argument as map_to_yaml, and std::runtime_error naming a path that cannot be written or that holds
/// something else than a map.
void save_map(const std::string& path, const MapSnapshot& snapshot);

/// Throws std::invalid_argument as map_from_yaml, and std::runtime_error naming a path that cannot be read.
MapSnapshot load_map(const std::string& path);

/// The same; a map in another frame is refused, too.
MapSnapshot load_map(const std::string& path, const std::string& world_frame);

}  // namespace situation_awareness

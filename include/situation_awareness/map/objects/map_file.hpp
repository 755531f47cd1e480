// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <string>

#include "situation_awareness/map/objects/map_snapshot.hpp"

namespace situation_awareness {

// A map in a readable file (docs/map_file.md). Numbers are read back bit for bit. The last line has the SHA-256 of
// everything before it, to detect truncated and damaged files.

/// Throws std::invalid_argument as MapSnapshot::validate, or if the world frame is not a name, so that every written
/// file can be read.
std::string map_to_yaml(const MapSnapshot& snapshot);

/// Throws std::invalid_argument naming `source`, element and field if this is no valid map: see MapSnapshot::validate;
/// and each field must be there exactly once, and no other.
MapSnapshot map_from_yaml(const std::string& yaml, const std::string& source);

/// Write the file atomically: an existing one is replaced only when the new one is complete. Throws
/// std::invalid_argument as map_to_yaml, and std::runtime_error naming a path that cannot be written or whose file is
/// no map.
void save_map(const std::string& path, const MapSnapshot& snapshot);

/// Throws std::invalid_argument as map_from_yaml, and std::runtime_error naming a path that cannot be read.
MapSnapshot load_map(const std::string& path);

/// The same; a map in another frame is refused, too.
MapSnapshot load_map(const std::string& path, const std::string& world_frame);

}  // namespace situation_awareness

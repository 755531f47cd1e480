// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <string>

#include "situation_awareness/map/id_source.hpp"
#include "situation_awareness/map/map.hpp"

namespace situation_awareness {

/// A map as a file holds it (docs/map_file.md).
struct SavedMap {
  std::string world_frame;
  FeatureId next_id = 1;  ///< of the next new feature of the program that saved it
  Map map;
};

/// One object of JSON: "format", "version", "world_frame", "stamp" (s), "height" (m), "next_id", and "features", each
/// on a line of its own (map/feature_json.hpp). Throws as add_feature.
std::string map_to_json(const SavedMap& saved);

/// Reads such an object; features without an id are given one. Throws std::invalid_argument naming `source`, feature,
/// member and reason if it is none, an id is there twice, something is seen after the stamp, or its frame is not
/// `world_frame`, where that is not empty.
SavedMap map_from_json(const std::string& text, const std::string& source, const std::string& world_frame);

/// Writes the file atomically: an existing one is replaced only when the new one is complete. Throws std::runtime_error
/// naming a path that cannot be written, or whose file is no map.
void save_features(const std::string& path, const SavedMap& saved);

/// Throws as map_from_json, and std::runtime_error naming a path that cannot be read.
SavedMap load_features(const std::string& path, const std::string& world_frame);

}  // namespace situation_awareness

// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <string>
#include <vector>

#include <Eigen/Core>

namespace situation_awareness {

/// An upright cylinder of retroreflecting material at a surveyed place.
struct Reflector {
  Eigen::Vector2d center_world_m = Eigen::Vector2d::Zero();
  double radius_m = 0.0;
};

/// The reflectors that a robot localises itself by, in the order of their file; others name them by their index.
struct ReflectorMap {
  std::vector<Reflector> reflectors;
};

/// Throws std::invalid_argument naming `source`, the index, the field and its bound, unless there are from one to
/// 10,000 reflectors, coordinates are in [-1e6, 1e6] m and radii in (0, 1] m, and no two reflectors overlap.
void check_reflectors(const ReflectorMap& map, const std::string& source);

/// A map from YAML text:
///
///     reflectors:
///       - {x: 1.5, y: -0.25, radius_m: 0.05}     # x and y in m, in the world
///
/// Throws std::invalid_argument naming `source` for what is no such text, for unknown, missing and repeated keys, and
/// as check_reflectors does.
ReflectorMap read_reflector_map(const std::string& yaml, const std::string& source);

/// The same from a file, which is the source. Throws std::invalid_argument also if it cannot be read.
ReflectorMap load_reflector_map(const std::string& path);

/// Writes a file that load_reflector_map reads back exactly, as NewFile does: in place of one of reflectors, or of
/// none. Throws std::runtime_error naming a path that cannot be written, and as check_reflectors.
void save_reflector_map(const std::string& path, const ReflectorMap& map);

/// The map as YAML text that read_reflector_map reads back exactly.
std::string yaml_text(const ReflectorMap& map);

}  // namespace situation_awareness

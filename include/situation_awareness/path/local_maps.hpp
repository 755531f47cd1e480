// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstddef>
#include <string>
#include <vector>

#include "situation_awareness/map/map.hpp"
#include "situation_awareness/map/polygons/polygons.hpp"
#include "situation_awareness/path/spline_path.hpp"

namespace situation_awareness {

/// The chains within reach of a segment of a path, anchored to it: in the frame of the path's pose at its begin
/// (polygons paper, Sect. 4).
struct LocalMap {
  std::size_t segment = 0;
  std::vector<Chain> chains;  ///< their `p_world_m` are places in the segment's frame
};

/// The local maps of all segments, by their index. A polyline of the map, or a boundary as lines, is a chain in those
/// of all segments to which it comes as near as `reach_m`; its state is by its extent, motion and probability.
std::vector<LocalMap> local_maps(const SplinePath& path, const Map& map, double reach_m);

/// The chains of local maps in the world, each once, as a map without a stamp: it is not known that they are still
/// there. With another path they are where its segments are.
Map map_of(const std::vector<LocalMap>& maps, const SplinePath& path);

/// Throws std::invalid_argument naming `source`, the place and its bound, unless segments are those of the path, by
/// increasing index, chains have ids > 0, each once in a map, and at least two vertices, places are within 1e6 m,
/// sigmas in (0, 100] m, stamps >= 0 and probabilities in [0, 1].
void check_local_maps(const std::vector<LocalMap>& maps, std::size_t segments, const std::string& source);

/// As YAML text that read_local_maps reads back exactly:
///
///     local_maps:
///       - segment: 0
///         chains:
///           - {id: 3, closed: false, state: known, p_exists: 0.99, first_seen_ns: 1, last_seen_ns: 2,
///              vertices: [[1.5, 0.4, 0.01], ...]}      # x and y in the segment's frame, and sigma, in m
std::string yaml_text(const std::vector<LocalMap>& maps);

/// Throws std::invalid_argument naming `source` for what is no such text, and as check_local_maps does.
std::vector<LocalMap> read_local_maps(const std::string& yaml, std::size_t segments, const std::string& source);

/// The same from a file.
std::vector<LocalMap> load_local_maps(const std::string& file, std::size_t segments);

/// Replaces the file at once. Throws std::runtime_error naming it if it cannot be written.
void save_local_maps(const std::vector<LocalMap>& maps, const std::string& file);

}  // namespace situation_awareness

// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <string>

#include "situation_awareness/map/polygons/polygons.hpp"

namespace situation_awareness {

// Chains as GeoJSON (RFC 7946): a FeatureCollection with a LineString for each chain, or a Polygon of one ring for a
// closed one. Coordinates are x, y in m in the frame `world_frame`, a member beside the features, not longitude and
// latitude. Properties: id, closed, sigma_m (one per vertex), first_seen, last_seen (s), p, state (as text, which is
// not read) and, of a Polygon, free_side (`outside` or `inside`), since RFC 7946 orders its vertices counter-clockwise.
// A line has its free side to the left of the way from a vertex to the next, as Chain has.

/// Numbers are read back exactly, times within 1 us.
std::string polygons_to_geojson(const Polygons& polygons, const std::string& world_frame);

/// For plans drawn by hand every property may be missing: ids are then given, sigma_m is 0.02 m, times are that of the
/// collection (`stamp`, else 0), p is 0.9975, and closed is that of the geometry. Throws std::invalid_argument naming
/// `source`, feature and reason if this is no such collection, a number is not finite or out of bounds, an id is there
/// twice, or `world_frame` is there and another one.
Polygons polygons_from_geojson(const std::string& text, const std::string& source, const std::string& world_frame);

/// Atomically, as a map file. Throws std::runtime_error naming a path that cannot be written or whose file is none.
void save_geojson(const std::string& path, const Polygons& polygons, const std::string& world_frame);

/// Throws as polygons_from_geojson, and std::runtime_error naming a path that cannot be read.
Polygons load_geojson(const std::string& path, const std::string& world_frame);

}  // namespace situation_awareness

// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <string>

#include "situation_awareness/map/splinegons/splinegons.hpp"

namespace situation_awareness {

// Boundaries as GeoJSON (RFC 7946): a FeatureCollection with a LineString for each open boundary, and a Polygon of one
// ring for each closed one. Coordinates are x, y in m in the frame `world_frame`, a member beside the features, not
// longitude and latitude: vertices and joints, the arcs between them by the property bulge. Properties: id, bulge,
// sigma_m, corner (each one per vertex), first_seen, last_seen (s). Counter-clockwise around the obstacle.

/// Numbers are read back exactly, times within 1 us.
std::string splinegons_to_geojson(const Splinegons& splinegons, const std::string& world_frame);

/// For plans drawn by hand every property may be missing: ids are then given, sigma_m is 0.02 m, times are that of the
/// collection (`stamp`, else 0); without bulge edges are straight, between corners. Throws std::invalid_argument naming
/// `source`, feature and reason if this is no such collection, a number is not finite or out of bounds, a ring is not
/// counter-clockwise, neighbouring vertices are the same, main vertices and joints cannot alternate, an id is there
/// twice, or `world_frame` is there and another one.
Splinegons splinegons_from_geojson(const std::string& text, const std::string& source, const std::string& world_frame);

/// Atomically, as a map file. Throws std::runtime_error naming a path that cannot be written or whose file is none.
void save_geojson(const std::string& path, const Splinegons& splinegons, const std::string& world_frame);

/// Throws as splinegons_from_geojson, and std::runtime_error naming a path that cannot be read.
Splinegons load_splinegons_geojson(const std::string& path, const std::string& world_frame);

}  // namespace situation_awareness

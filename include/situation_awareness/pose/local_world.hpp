// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <string>

#include <Eigen/Core>

namespace situation_awareness {

/// A place on the WGS 84 ellipsoid.
struct GeodeticPosition {
  double latitude_deg = 0.0;
  double longitude_deg = 0.0;
  double altitude_m = 0.0;  ///< above the ellipsoid
};

/// Whether the numbers are finite and the latitude is in [-90, 90], the longitude in [-360, 360] degrees.
bool is_valid(const GeodeticPosition& position);

/// From text, "LAT,LON,ALT" in degrees and m. Throws std::invalid_argument naming `source`.
GeodeticPosition parse_geodetic_position(const std::string& text, const std::string& source);

/// East, north and up (m) of a place in the Cartesian frame that is tangent to the ellipsoid at `origin`
/// (GeographicLib::LocalCartesian). Covariances of east, north and up are taken as they are: at a distance d their axes
/// are turned by d / 6400 km, which is neglected.
Eigen::Vector3d local_position(const GeodeticPosition& origin, const GeodeticPosition& position);

/// The inverse of local_position.
GeodeticPosition geodetic_position(const GeodeticPosition& origin, const Eigen::Vector3d& p_world_m);

}  // namespace situation_awareness

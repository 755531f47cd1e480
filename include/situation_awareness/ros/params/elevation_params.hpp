// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <string>

#include "situation_awareness/common/params.hpp"
#include "situation_awareness/map/grid/elevation_file.hpp"
#include "situation_awareness/pose/local_world.hpp"

namespace situation_awareness {

/// The elevation's file as users name it, for nodelets and tools.
struct ElevationParams {
  std::string dem;
  std::string origin;
  std::string dem_vertical;
  double dem_geoid_m = 0.0;

  template <class Self, class Visit>
  static void fields(Self& self, Visit&& visit) {
    visit("dem", self.dem,
          "path of the elevation, a GeoTIFF or another raster that GDAL reads: with a CRS, if origin is given, else in "
          "the world's metres; empty: level ground for scout, scouting.height_m below the begin");
    visit(
        "origin", self.origin,
        "of the world, \"LAT,LON,ALT\" in degrees and m above the ellipsoid, that of gps_ins: an elevation with a CRS "
        "is laid there; empty: the world has none");
    visit(
        "dem_vertical", self.dem_vertical,
        "what its heights are above: egm96, egm2008 (the sea), ellipsoid, or local (the world's zero); empty: what its "
        "CRS says");
    visit("dem_geoid_m", self.dem_geoid_m, Bounds{-120.0, 120.0}, "m",
          "height of the sea above the ellipsoid, instead of that of a geoid's grid; 0: by the grid");
  }
};

/// Throws std::invalid_argument naming `source` if the origin is none.
inline ElevationSource elevation_source(const ElevationParams& params, const std::string& source) {
  ElevationSource of{params.dem, {}, params.dem_vertical, params.dem_geoid_m};
  if (params.origin.empty()) return of;
  const GeodeticPosition origin = parse_geodetic_position(params.origin, source);
  of.origin = EarthOrigin{origin.latitude_deg, origin.longitude_deg, origin.altitude_m};
  return of;
}

}  // namespace situation_awareness

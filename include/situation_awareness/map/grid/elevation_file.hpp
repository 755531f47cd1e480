// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <memory>
#include <optional>
#include <string>
#include <vector>

#include <Eigen/Core>
#include <Eigen/Geometry>

#include "situation_awareness/map/grid/elevation.hpp"

namespace situation_awareness {

/// Where a world's east, north and up begin on the ellipsoid of WGS 84.
struct EarthOrigin {
  double latitude_deg = 0.0;
  double longitude_deg = 0.0;
  double altitude_m = 0.0;  ///< above the ellipsoid
};

/// An elevation's file, and how its numbers are to be taken.
struct ElevationSource {
  std::string path;
  std::optional<EarthOrigin> origin = {};  ///< of the world, if it has one
  /// What its heights are above: egm96 or egm2008, the sea by that geoid; ellipsoid, that of WGS 84; local, the world's
  /// zero. Empty: what its CRS says, else the ellipsoid if it has a CRS and the world an origin, else the world's zero.
  std::string vertical = {};
  double geoid_m = 0.0;  ///< height of the geoid above the ellipsoid, instead of that of a grid; 0: by the grid
};

/// A raster of heights, of which what is in view is read and laid over the world's metres. With a CRS, and in a world
/// with an origin, its pixels go to where they are in the local east, north and up of the origin; else its coordinates
/// are the world's. Its first band's scale, offset, unit, mask and no data are heeded.
class ElevationFile {
 public:
  /// Throws std::runtime_error naming the file, what is wrong and what helps: it cannot be read or is no raster of
  /// heights; its coordinates are no metres and the world has no origin; the height of the geoid is not known, as
  /// neither GeographicLib nor PROJ has its grid.
  explicit ElevationFile(const ElevationSource& source);
  ElevationFile(ElevationFile&&) noexcept;
  ~ElevationFile();

  /// Its heights at least so far around a place: the same object as before while that has them. All of a raster that is
  /// small, which is read once. Pixels finer than `finest_m` may be merged. Throws std::runtime_error as above.
  std::shared_ptr<const Elevation> around(const Eigen::Vector2d& p_world_m, double reach_m, double finest_m);

  /// All of it, whatever that takes. Throws std::runtime_error.
  Elevation whole();

  /// Where its pixels are, at most, at about their height; empty if no height is known.
  Eigen::AlignedBox3d extent_world_m() const;

  /// What was assumed of it, each in a sentence that begins with the path.
  std::vector<std::string> warnings() const;

  /// What may help where it is not in view: its coordinates are those of a CRS in a world without an origin. Or empty.
  const std::string& remedy() const;

 private:
  class Impl;
  std::unique_ptr<Impl> impl_;
};

}  // namespace situation_awareness

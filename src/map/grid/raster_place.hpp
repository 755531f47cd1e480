// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <array>
#include <memory>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include <gdal.h>
#include <Eigen/Core>
#include <Eigen/Geometry>
#include <GeographicLib/LocalCartesian.hpp>

#include "geoid.hpp"
#include "situation_awareness/map/grid/elevation_file.hpp"

namespace situation_awareness {

/// A place in a raster, in columns and rows from its first corner, and what its height there (m) is to be raised by.
using RasterPoint = Eigen::Vector3d;

/// Length of the unit of the heights by the raster's CRS, in m; 1 where that has none.
double crs_height_unit_m(GDALDatasetH dataset);

/// Where the pixels of a raster are in the world, and its heights.
class RasterPlace {
 public:
  /// `typical_m`: a height of the raster; NaN if none is known. Throws std::invalid_argument with what is wrong.
  RasterPlace(GDALDatasetH dataset, const ElevationSource& source, double typical_m);

  /// Whether columns and rows are along the world's axes, and its heights those of the world.
  bool is_aligned() const { return is_aligned_; }
  /// Of such ones the first corner and the pixels' size to the east and to the south, negative where rows go north.
  std::pair<Eigen::Vector2d, Eigen::Vector2d> aligned_pixels() const {
    return {{transform_[0], transform_[3]}, {transform_[1], -transform_[5]}};
  }
  /// The lesser edge of a pixel, in its middle.
  double pixel_m() const { return pixel_m_; }

  /// Not finite where it has no place.
  RasterPoint in_raster(const Eigen::Vector2d& p_world_m) const;
  /// What a box of the world needs of the raster; empty if nothing.
  Eigen::AlignedBox2d raster_box(const Eigen::AlignedBox2d& box_world_m) const;
  const Eigen::AlignedBox2d& extent_world_m() const { return extent_world_m_; }

  const std::string& warning() const { return warning_; }  ///< of what was assumed
  const std::string& remedy() const { return remedy_; }    ///< as that of ElevationFile

 private:
  class Crs;

  std::optional<Eigen::Vector2d> in_world(const Eigen::Vector2d& p_raster) const;
  void set_vertical(const ElevationSource& source, const std::string& of_crs, double typical_m);
  void set_extent();

  std::array<double, 6> transform_{}, inverse_{};
  int columns_, rows_;
  std::shared_ptr<const Crs> crs_;                      ///< null: its coordinates are the world's
  std::optional<GeographicLib::LocalCartesian> world_;  ///< where it matters
  EarthOrigin origin_;
  HeightAboveEllipsoid zero_;  ///< of its heights; empty: they are the world's
  double ellipsoid_m_ = 0.0;   ///< of what is laid over the world, about
  bool is_aligned_ = false;
  double pixel_m_ = 1.0;
  Eigen::AlignedBox2d extent_world_m_;
  std::string warning_, remedy_;
};

}  // namespace situation_awareness

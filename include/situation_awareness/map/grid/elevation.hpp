// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstddef>
#include <string>
#include <vector>

#include <Eigen/Core>
#include <Eigen/Geometry>

namespace situation_awareness {

/// Heights of the ground over the world's x and y: a raster with square or oblong pixels along the axes, north (y) up,
/// each the height at its middle (pixel-is-area), bilinear in between. Within half a pixel of its edge it is that of
/// the nearest middle; beyond, and beside pixels without data, it is not known (NaN).
class Elevation {
 public:
  /// `heights_world_m`: rows from the north, NaN where not known. `corner_world_m`: the north-west corner of the
  /// raster. `pixel_m`: its pixel's size to the east and to the south, above 0. Throws std::invalid_argument if a
  /// number is not as said.
  Elevation(int width, int height, const Eigen::Vector2d& corner_world_m, const Eigen::Vector2d& pixel_m,
            std::vector<float> heights_world_m);

  /// All of a raster that GDAL reads, such as a GeoTIFF, in the world's metres, as an ElevationFile has it. Throws
  /// std::runtime_error naming the file and what is wrong.
  static Elevation load(const std::string& path);

  /// As a GeoTIFF that `load` reads. Throws std::runtime_error naming the path.
  void save(const std::string& path) const;

  /// Without noise of single pixels: Gaussian means with that standard deviation, above 0, of the known pixels. A plane
  /// stays as it is, and what is not known. Pixels that are more than 32 times smaller than the standard deviation are
  /// merged before: time is linear in their number.
  Elevation smoothed(double sigma_m) const;

  int width() const { return width_; }
  int height() const { return height_; }
  const Eigen::Vector2d& corner_world_m() const { return corner_world_m_; }
  const Eigen::Vector2d& pixel_m() const { return pixel_m_; }

  /// All pixels, from the lowest known height to the highest; empty if none is known.
  Eigen::AlignedBox3d box_world_m() const;

  /// NaN where it is not known.
  double at(double x_world_m, double y_world_m) const;

  /// The heights of `count` places along a straight line, as at() has them. Their distances from its begin ascend.
  void along(const Eigen::Vector2d& begin_world_m, const Eigen::Vector2d& direction, const double* distances_m,
             std::size_t count, double* heights_world_m) const;

 private:
  Elevation merged(int columns, int rows) const;
  Elevation smoothed_as_is(double sigma_m) const;
  double value(int column, int row) const {
    return static_cast<double>(
        heights_[static_cast<std::size_t>(row) * static_cast<std::size_t>(width_) + static_cast<std::size_t>(column)]);
  }

  int width_, height_;
  Eigen::Vector2d corner_world_m_, pixel_m_;
  std::vector<float> heights_;
};

}  // namespace situation_awareness

// SPDX-License-Identifier: BSD-3-Clause
#include "situation_awareness/map/grid/elevation.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <cstring>
#include <limits>
#include <stdexcept>
#include <utility>

#include "gdal_dataset.hpp"
#include "several_at_once.hpp"
#include "situation_awareness/common/file.hpp"
#include "situation_awareness/map/grid/elevation_file.hpp"

namespace situation_awareness {
namespace {

constexpr double kFinest = 16.0;  ///< pixels per standard deviation that smoothing needs
constexpr double kUnknown = std::numeric_limits<double>::quiet_NaN();

constexpr std::size_t kAtOnce = 32;

/// Places in a raster, each right of a pixel's middle and below it.
struct Places {
  std::array<std::int32_t, kAtOnce> columns, rows;
  std::array<double, kAtOnce> to_right, below;  ///< of the way to the next pixels
};

/// A line through a raster.
struct Line {
  double x_m, y_m, west_m, north_m, ahead_x, ahead_y, columns_per_m, rows_per_m;

  double column(double away_m) const { return (x_m + away_m * ahead_x - west_m) * columns_per_m - 0.5; }
  double row(double away_m) const { return (north_m - (y_m + away_m * ahead_y)) * rows_per_m - 0.5; }
};

/// Two pixels side by side.
using Pair = std::array<float, 2>;

SITUATION_AWARENESS_SEVERAL_AT_ONCE
void find_places(const Line& on, const double* away_m, std::size_t count, Places& at) {
  const Line line = on;
#pragma GCC ivdep
  for (std::size_t i = 0; i < count; ++i) {
    const double column = line.column(away_m[i]), row = line.row(away_m[i]);
    const auto whole_column = static_cast<std::int32_t>(column), whole_row = static_cast<std::int32_t>(row);
    at.columns[i] = whole_column;
    at.rows[i] = whole_row;
    at.to_right[i] = column - static_cast<double>(whole_column);
    at.below[i] = row - static_cast<double>(whole_row);
  }
}

/// Interpolates between four pixels of each place. False if any of them is not known.
SITUATION_AWARENESS_SEVERAL_AT_ONCE
bool interpolate(const std::array<Pair, kAtOnce>& above, const std::array<Pair, kAtOnce>& under, const Places& at,
                 std::size_t count, double* heights_m) {
  std::int32_t unknown = 0;
#pragma GCC ivdep
  for (std::size_t i = 0; i < count; ++i) {
    const double right = at.to_right[i], left = 1.0 - right, below = at.below[i];
    const double upper_m = left * static_cast<double>(above[i][0]) + right * static_cast<double>(above[i][1]);
    const double lower_m = left * static_cast<double>(under[i][0]) + right * static_cast<double>(under[i][1]);
    const double height_m = (1.0 - below) * upper_m + below * lower_m;
    heights_m[i] = height_m;
    unknown |= std::isnan(height_m) ? 1 : 0;
  }
  return unknown == 0;
}

/// Finds the heights of places of a line, all of which are between four pixels of the raster, whose rows have `width`
/// pixels.
bool find_between(const Line& line, const float* heights, std::size_t width, const double* away_m, std::size_t count,
                  double* heights_m) {
  Places at;
  std::array<Pair, kAtOnce> above, under;
  find_places(line, away_m, count, at);
  for (std::size_t i = 0; i < count; ++i) {
    const float* const pixel =
        heights + static_cast<std::size_t>(at.rows[i]) * width + static_cast<std::size_t>(at.columns[i]);
    std::memcpy(&above[i], pixel, sizeof(Pair));
    std::memcpy(&under[i], pixel + width, sizeof(Pair));
  }
  return interpolate(above, under, at, count, heights_m);
}

}  // namespace

Elevation::Elevation(int width, int height, const Eigen::Vector2d& corner_world_m, const Eigen::Vector2d& pixel_m,
                     std::vector<float> heights_world_m)
    : width_(width),
      height_(height),
      corner_world_m_(corner_world_m),
      pixel_m_(pixel_m),
      heights_(std::move(heights_world_m)) {
  if (width < 1 || height < 1 ||
      heights_.size() != static_cast<std::size_t>(width) * static_cast<std::size_t>(height)) {
    throw std::invalid_argument("an elevation's number of heights is not that of its pixels");
  }
  if (!corner_world_m.allFinite() || !pixel_m.allFinite() || pixel_m.minCoeff() <= 0.0) {
    throw std::invalid_argument("an elevation's corner is not finite or its pixel's size not above 0");
  }
  for (float& height_m : heights_) {
    if (!std::isfinite(height_m)) height_m = std::numeric_limits<float>::quiet_NaN();
  }
}

Elevation Elevation::load(const std::string& path) { return ElevationFile({path}).whole(); }

void Elevation::save(const std::string& path) const {
  constexpr const char* kDescription = "situation_awareness elevation";
  NewFile file(path, kind_with_mark("an elevation that was written here", kDescription));
  const QuietGdal quiet;
  Dataset dataset(
      GDALCreate(GDALGetDriverByName("GTiff"), file.partial().c_str(), width_, height_, 1, GDT_Float32, nullptr));
  if (!dataset) throw std::runtime_error(path + ": cannot be written: " + CPLGetLastErrorMsg());
  std::array<double, 6> transform{corner_world_m_.x(), pixel_m_.x(), 0.0, corner_world_m_.y(), 0.0, -pixel_m_.y()};
  std::vector<float> heights = heights_;
  GDALRasterBandH const band = GDALGetRasterBand(dataset.get(), 1);
  GDALSetMetadataItem(dataset.get(), "TIFFTAG_IMAGEDESCRIPTION", kDescription, nullptr);
  GDALSetGeoTransform(dataset.get(), transform.data());
  GDALSetRasterNoDataValue(band, kUnknown);
  const CPLErr result =
      GDALRasterIO(band, GF_Write, 0, 0, width_, height_, heights.data(), width_, height_, GDT_Float32, 0, 0);
  dataset.reset();  // writes
  if (result != CE_None || CPLGetLastErrorType() >= CE_Failure) {
    throw std::runtime_error(path + ": cannot be written: " + CPLGetLastErrorMsg());
  }
  file.finish();
}

/// Means of the known pixels in so many columns and rows of blocks, each as large as the others but for one pixel.
Elevation Elevation::merged(int columns, int rows) const {
  std::vector<double> sums(static_cast<std::size_t>(columns) * static_cast<std::size_t>(rows), 0.0);
  std::vector<double> counts(sums.size(), 0.0);
  for (int row = 0; row < height_; ++row) {
    const std::int64_t block_row = std::int64_t{row} * rows / height_;
    for (int column = 0; column < width_; ++column) {
      const double height_m = value(column, row);
      if (std::isnan(height_m)) continue;
      const auto block = static_cast<std::size_t>(block_row * columns + std::int64_t{column} * columns / width_);
      sums[block] += height_m;
      counts[block] += 1.0;
    }
  }
  std::vector<float> heights(sums.size());
  for (std::size_t i = 0; i < sums.size(); ++i) {  // NaN where none is known
    heights[i] = static_cast<float>(sums[i] / counts[i]);
  }
  return {columns, rows, corner_world_m_, {pixel_m_.x() * width_ / columns, pixel_m_.y() * height_ / rows}, heights};
}

Elevation Elevation::smoothed(double sigma_m) const {
  const auto pixels = [sigma_m](int count, double pixel_m) {
    const double at_once = std::floor(sigma_m / (kFinest * pixel_m));
    return at_once < 2.0 ? count : std::max(1, static_cast<int>(count / at_once));
  };
  const int columns = pixels(width_, pixel_m_.x()), rows = pixels(height_, pixel_m_.y());
  if (columns < width_ || rows < height_) return merged(columns, rows).smoothed_as_is(sigma_m);
  return smoothed_as_is(sigma_m);
}

Elevation Elevation::smoothed_as_is(double sigma_m) const {
  // Gaussian along columns, then rows, each over three standard deviations; pixels without data have no weight.
  const auto kernel_of = [sigma_m](double pixel_m, int count) {
    std::vector<double> kernel;
    for (int i = 0; i <= std::min(std::ceil(3.0 * sigma_m / pixel_m), 0.5 * count); ++i) {
      kernel.push_back(std::exp(-0.5 * std::pow(i * pixel_m / sigma_m, 2)));
    }
    return kernel;
  };
  std::vector<double> sums(heights_.size()), weights(heights_.size());
  for (std::size_t i = 0; i < heights_.size(); ++i) {
    weights[i] = std::isnan(heights_[i]) ? 0.0 : 1.0;
    sums[i] = std::isnan(heights_[i]) ? 0.0 : static_cast<double>(heights_[i]);
  }
  const auto smooth = [&](std::vector<double>& values, int count, int lines, std::size_t step, std::size_t line_step,
                          const std::vector<double>& kernel) {
    std::vector<double> line(static_cast<std::size_t>(count));
    std::vector<double> all;  // of the kernel's weights, by its reach
    for (int reach = 0; reach < static_cast<int>(kernel.size()); ++reach) {
      all.push_back(0.0);
      for (int j = -reach; j <= reach; ++j) all.back() += kernel[static_cast<std::size_t>(std::abs(j))];
    }
    for (int k = 0; k < lines; ++k) {
      const std::size_t begin = static_cast<std::size_t>(k) * line_step;
      for (int i = 0; i < count; ++i)
        line[static_cast<std::size_t>(i)] = values[begin + static_cast<std::size_t>(i) * step];
      for (int i = 0; i < count; ++i) {
        double sum = 0.0;
        const int reach =
            std::min({static_cast<int>(kernel.size()) - 1, i, count - 1 - i});  // keeps planes at the edge
        for (int j = -reach; j <= reach; ++j) {
          sum += kernel[static_cast<std::size_t>(std::abs(j))] * line[static_cast<std::size_t>(i + j)];
        }
        values[begin + static_cast<std::size_t>(i) * step] = sum / all[static_cast<std::size_t>(reach)];
      }
    }
  };
  const auto width = static_cast<std::size_t>(width_);
  for (std::vector<double>* const values : {&sums, &weights}) {
    smooth(*values, width_, height_, 1, width, kernel_of(pixel_m_.x(), width_));
    smooth(*values, height_, width_, width, 1, kernel_of(pixel_m_.y(), height_));
  }
  Elevation result = *this;
  for (std::size_t i = 0; i < heights_.size(); ++i) {
    if (!std::isnan(heights_[i])) result.heights_[i] = static_cast<float>(sums[i] / weights[i]);
  }
  return result;
}

Eigen::AlignedBox3d Elevation::box_world_m() const {
  Eigen::AlignedBox3d box;
  const double right_m = corner_world_m_.x() + width_ * pixel_m_.x(),
               low_m = corner_world_m_.y() - height_ * pixel_m_.y();
  for (const float height_m : heights_) {
    if (std::isnan(height_m)) continue;
    box.extend(Eigen::Vector3d(corner_world_m_.x(), low_m, static_cast<double>(height_m)));
    box.extend(Eigen::Vector3d(right_m, corner_world_m_.y(), static_cast<double>(height_m)));
  }
  return box;
}

double Elevation::at(double x_world_m, double y_world_m) const {
  double height_m = 0.0;
  constexpr double kHere = 0.0;
  along({x_world_m, y_world_m}, Eigen::Vector2d::Zero(), &kHere, 1, &height_m);
  return height_m;
}

void Elevation::along(const Eigen::Vector2d& begin_world_m, const Eigen::Vector2d& direction, const double* distances_m,
                      std::size_t count, double* heights_world_m) const {
  std::array<double, kAtOnce> inside, right, down, a, b, c, d;
  std::array<std::int32_t, kAtOnce> columns, rows;
  const Line line{begin_world_m.x(), begin_world_m.y(), corner_world_m_.x(), corner_world_m_.y(),
                  direction.x(),     direction.y(),     1.0 / pixel_m_.x(),  1.0 / pixel_m_.y()};
  const double last_column = width_ - 1.0, last_row = height_ - 1.0;
  const std::int32_t most_column = std::max(width_ - 2, 0), most_row = std::max(height_ - 2, 0);
  const std::size_t next_column = width_ > 1 ? 1 : 0, next_row = height_ > 1 ? static_cast<std::size_t>(width_) : 0;
  const auto is_between = [&](double away_m) {
    const double column = line.column(away_m), row = line.row(away_m);
    return column >= 0.0 && row >= 0.0 && column < last_column && row < last_row;
  };
  for (std::size_t first = 0; first < count; first += kAtOnce) {
    const std::size_t n = std::min(kAtOnce, count - first);
    const double* const away_m = distances_m + first;
    double* const heights_m = heights_world_m + first;
    if (is_between(away_m[0]) && is_between(away_m[n - 1]) &&
        find_between(line, heights_.data(), static_cast<std::size_t>(width_), away_m, n, heights_m)) {
      continue;
    }
    for (std::size_t i = 0; i < n; ++i) {
      const double column = line.column(away_m[i]);
      const double row = line.row(away_m[i]);
      inside[i] = column >= -0.5 && column <= last_column + 0.5 && row >= -0.5 && row <= last_row + 0.5 ? 1.0 : 0.0;
      const double u = column > 0.0 ? column : 0.0, v = row > 0.0 ? row : 0.0;
      right[i] = u < last_column ? u : last_column;
      down[i] = v < last_row ? v : last_row;
    }
    for (std::size_t i = 0; i < n; ++i) {
      columns[i] = std::min(static_cast<std::int32_t>(right[i]), most_column);
      rows[i] = std::min(static_cast<std::int32_t>(down[i]), most_row);
    }
    for (std::size_t i = 0; i < n; ++i) {
      const float* const pixel = &heights_[static_cast<std::size_t>(rows[i]) * static_cast<std::size_t>(width_) +
                                           static_cast<std::size_t>(columns[i])];
      a[i] = static_cast<double>(pixel[0]);
      b[i] = static_cast<double>(pixel[next_column]);
      c[i] = static_cast<double>(pixel[next_row]);
      d[i] = static_cast<double>(pixel[next_row + next_column]);
    }
    // A neighbour of weight 0 does not make it unknown.
    const auto mix = [](double one, double other, double part) {
      const double mean = (1.0 - part) * one + part * other;
      return part == 0.0 ? one : part == 1.0 ? other : mean;
    };
    for (std::size_t i = 0; i < n; ++i) {
      const double to_right = right[i] - columns[i], below = down[i] - rows[i];
      const double height_m = mix(mix(a[i], b[i], to_right), mix(c[i], d[i], to_right), below);
      heights_m[i] = inside[i] != 0.0 ? height_m : kUnknown;
    }
  }
}

}  // namespace situation_awareness

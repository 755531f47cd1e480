// SPDX-License-Identifier: BSD-3-Clause
#include "situation_awareness/map/grid/elevation_file.hpp"

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <limits>
#include <stdexcept>
#include <utility>

#include <cpl_conv.h>

#include "gdal_dataset.hpp"
#include "height_band.hpp"
#include "raster_place.hpp"

namespace situation_awareness {
namespace {

/// Pixels of a raster that is read as a whole, of any size and of those that may be merged, and the farthest of one
/// that is laid over the world as a whole.
constexpr double kSmall = 1 << 24, kSmallAndFine = 1 << 20, kNear_m = 1e5;
/// Pixels of a block, at most: one is read for each pixel that is asked for.
constexpr double kMostOfBlock = 1 << 26;
/// A part is so much larger than asked for, in its reach.
constexpr double kPart = 1.5;
/// Pixels between places that are found exactly.
constexpr int kLattice = 32;
constexpr double kUnknown = std::numeric_limits<double>::quiet_NaN();

[[noreturn]] void refuse(const std::string& path, const std::string& reason) {
  throw std::runtime_error(path + ": no elevation: " + reason);
}

Dataset opened(const std::string& path) {
  Dataset dataset(GDALOpen(path.c_str(), GA_ReadOnly));
  if (!dataset) refuse(path, std::string("it cannot be read (") + CPLGetLastErrorMsg() + ")");
  if (GDALGetRasterCount(dataset.get()) < 1) refuse(path, "it has no band");
  int block_columns = 0, block_rows = 0;
  GDALGetBlockSize(GDALGetRasterBand(dataset.get(), 1), &block_columns, &block_rows);
  if (static_cast<double>(block_columns) * block_rows > kMostOfBlock) {
    refuse(path, "its blocks have more than 2^26 pixels: gdal_translate -co TILED=YES makes smaller ones");
  }
  // GDAL leaves out what an older GeoTIFF says of its heights, unless it is told to when the CRS is read first.
  const CPLConfigOptionSetter with_vertical("GTIFF_REPORT_COMPD_CS", "YES", true);
  GDALGetSpatialRef(dataset.get());
  return dataset;
}

Elevation unknown_elevation() { return {1, 1, {0.0, 0.0}, {1.0, 1.0}, {std::numeric_limits<float>::quiet_NaN()}}; }

/// Part of a raster, each of its pixels the mean of `merged` x `merged` ones.
struct Part {
  int column = 0, row = 0, width = 0, height = 0, merged = 1;
  std::vector<float> heights = {};

  double pixel(int c, int r) const {
    return static_cast<double>(
        heights[static_cast<std::size_t>(r) * static_cast<std::size_t>(width) + static_cast<std::size_t>(c)]);
  }

  /// Between the middles of four pixels; that of the nearest within half a pixel of the edge; NaN beyond.
  double at(double raster_column, double raster_row) const {
    const double u = (raster_column - column) / merged, v = (raster_row - row) / merged;
    if (!(u >= 0.0 && v >= 0.0 && u <= width && v <= height)) return kUnknown;
    const double x = std::clamp(u - 0.5, 0.0, width - 1.0), y = std::clamp(v - 0.5, 0.0, height - 1.0);
    const int c = std::min(static_cast<int>(x), std::max(width - 2, 0));
    const int r = std::min(static_cast<int>(y), std::max(height - 2, 0));
    const auto mix = [](double one, double other, double part) {
      return part <= 0.0 ? one : part >= 1.0 ? other : (1.0 - part) * one + part * other;
    };
    const int next_c = std::min(c + 1, width - 1), next_r = std::min(r + 1, height - 1);
    return mix(mix(pixel(c, r), pixel(next_c, r), x - c), mix(pixel(c, next_r), pixel(next_c, next_r), x - c), y - r);
  }
};

}  // namespace

class ElevationFile::Impl {
 public:
  explicit Impl(const ElevationSource& source)
      : path_(source.path),
        dataset_(opened(source.path)),
        band_(made([&] { return HeightBand(dataset_.get(), crs_height_unit_m(dataset_.get())); })),
        place_(made([&] { return RasterPlace(dataset_.get(), source, band_.typical_m()); })) {}

  std::shared_ptr<const Elevation> around(const Eigen::Vector2d& p_world_m, double reach_m, double finest_m) {
    const auto box = [&p_world_m](double half_m) {
      const Eigen::Vector2d half(half_m, half_m);
      return Eigen::AlignedBox2d(p_world_m - half, p_world_m + half);
    };
    if (latest_ && (is_whole_ || latest_box_.contains(box(reach_m)))) return latest_;
    is_whole_ = is_small(finest_m);
    latest_box_ = box(kPart * reach_m);
    latest_ =
        std::make_shared<const Elevation>(is_whole_ ? part(place_.extent_world_m(), 0.0) : part(latest_box_, finest_m));
    return latest_;
  }

  Elevation whole() {
    const std::string defect = size_defect(dataset_.get(), path_);
    if (!defect.empty()) refuse(path_, defect);
    return part(place_.extent_world_m(), 0.0);
  }

  const std::string& path() const { return path_; }
  const RasterPlace& place() const { return place_; }

  Eigen::AlignedBox3d extent_world_m() const {
    const Eigen::AlignedBox2d& extent = place_.extent_world_m();
    const double height_m = band_.typical_m() + place_.in_raster(extent.center()).z();
    Eigen::AlignedBox3d box;
    if (!std::isfinite(height_m)) return box;
    for (const Eigen::Vector2d& corner : {extent.min(), extent.max()}) {
      box.extend(Eigen::Vector3d(corner.x(), corner.y(), height_m));
    }
    return box;
  }

  std::vector<std::string> warnings() const {
    std::vector<std::string> warnings;
    for (const std::string& warning : {place_.warning(), band_.undeclared_voids()}) {
      if (!warning.empty()) warnings.push_back(path_ + ": " + warning);
    }
    return warnings;
  }

 private:
  /// Errors of the file's parts are told with its path.
  template <class Make>
  auto made(const Make& make) -> decltype(make()) {
    try {
      return make();
    } catch (const std::exception& error) {
      refuse(path_, error.what());
    }
  }

  bool is_small(double finest_m) const {
    const double cells = static_cast<double>(band_.columns()) * band_.rows();
    if (cells > (2.0 * place_.pixel_m() > finest_m ? kSmall : kSmallAndFine)) return false;
    const Eigen::AlignedBox2d& extent = place_.extent_world_m();
    return place_.is_aligned() ||
           (extent.min().cwiseAbs().maxCoeff() < kNear_m && extent.max().cwiseAbs().maxCoeff() < kNear_m &&
            (extent.sizes() / place_.pixel_m()).prod() < 2.0 * kSmall);
  }

  Part read(Eigen::AlignedBox2d raster_box, int merged) {
    Part part;
    raster_box = raster_box.intersection(
        Eigen::AlignedBox2d(Eigen::Vector2d(0.0, 0.0), Eigen::Vector2d(band_.columns(), band_.rows())));
    if (raster_box.isEmpty()) return part;
    part.merged = std::clamp(merged, 1, std::min(band_.columns(), band_.rows()));
    part.column = static_cast<int>(std::floor(raster_box.min().x()));
    part.row = static_cast<int>(std::floor(raster_box.min().y()));
    part.width = static_cast<int>(std::ceil(raster_box.max().x() - part.column)) / part.merged;
    part.height = static_cast<int>(std::ceil(raster_box.max().y() - part.row)) / part.merged;
    if (part.width < 1 || part.height < 1) return {};
    part.heights = made([&] { return band_.read(part.column, part.row, part.width, part.height, part.merged); });
    return part;
  }

  /// The heights in a box of the world.
  Elevation part(const Eigen::AlignedBox2d& box, double finest_m) {
    const double finer = finest_m / place_.pixel_m();
    const int merged = finer < 2.0 ? 1 : static_cast<int>(std::min(finer, 1e4));
    Part part = read(place_.raster_box(box), merged);
    if (part.heights.empty()) return unknown_elevation();
    return place_.is_aligned() ? aligned(std::move(part)) : laid_over(part, box);
  }

  /// Pixels along the world's axes stay as they are.
  Elevation aligned(Part part) const {
    const auto [corner_m, pixel_m] = place_.aligned_pixels();
    const bool is_north_up = pixel_m.y() > 0.0;
    if (!is_north_up) {
      for (int r = 0; r < part.height / 2; ++r) {
        const auto row = [&part](int i) { return part.heights.begin() + std::ptrdiff_t{i} * part.width; };
        std::swap_ranges(row(r), row(r) + part.width, row(part.height - 1 - r));
      }
    }
    const int top = is_north_up ? part.row : part.row + part.height * part.merged;
    return {part.width,
            part.height,
            {corner_m.x() + part.column * pixel_m.x(), corner_m.y() - top * pixel_m.y()},
            {pixel_m.x() * part.merged, std::abs(pixel_m.y()) * part.merged},
            std::move(part.heights)};
  }

  /// Others are interpolated between, at places along the world's axes.
  Elevation laid_over(const Part& part, const Eigen::AlignedBox2d& box) {
    const double pixel_m = place_.pixel_m() * part.merged;
    const int width = std::max(1, static_cast<int>(std::ceil(box.sizes().x() / pixel_m)));
    const int height = std::max(1, static_cast<int>(std::ceil(box.sizes().y() / pixel_m)));
    const Eigen::Vector2d corner(box.min().x(), box.max().y());
    const int columns = (width - 1) / kLattice + 2, rows = (height - 1) / kLattice + 2;
    std::vector<RasterPoint> lattice;
    for (int r = 0; r < rows; ++r) {
      for (int c = 0; c < columns; ++c) {
        lattice.push_back(place_.in_raster(
            {corner.x() + (c * kLattice + 0.5) * pixel_m, corner.y() - (r * kLattice + 0.5) * pixel_m}));
      }
    }
    std::vector<float> heights;
    heights.reserve(static_cast<std::size_t>(width) * static_cast<std::size_t>(height));
    for (int r = 0; r < height; ++r) {
      const double v = static_cast<double>(r % kLattice) / kLattice;
      for (int c = 0; c < width; ++c) {
        const double u = static_cast<double>(c % kLattice) / kLattice;
        const RasterPoint* const above = &lattice[static_cast<std::size_t>((r / kLattice) * columns + c / kLattice)];
        const RasterPoint* const below = above + columns;
        const RasterPoint at =
            (1.0 - v) * ((1.0 - u) * above[0] + u * above[1]) + v * ((1.0 - u) * below[0] + u * below[1]);
        heights.push_back(static_cast<float>(part.at(at.x(), at.y()) + at.z()));
      }
    }
    return {width, height, corner, {pixel_m, pixel_m}, std::move(heights)};
  }

  std::string path_;
  Dataset dataset_;
  HeightBand band_;
  RasterPlace place_;
  Eigen::AlignedBox2d latest_box_;
  bool is_whole_ = false;
  std::shared_ptr<const Elevation> latest_;
};

ElevationFile::ElevationFile(const ElevationSource& source) {
  const QuietGdal quiet;
  impl_ = std::make_unique<Impl>(source);
}
ElevationFile::ElevationFile(ElevationFile&&) noexcept = default;
ElevationFile::~ElevationFile() = default;

std::shared_ptr<const Elevation> ElevationFile::around(const Eigen::Vector2d& p_world_m, double reach_m,
                                                       double finest_m) {
  const QuietGdal quiet;
  return impl_->around(p_world_m, reach_m, finest_m);
}
Elevation ElevationFile::whole() {
  const QuietGdal quiet;
  return impl_->whole();
}
Eigen::AlignedBox3d ElevationFile::extent_world_m() const {
  const QuietGdal quiet;
  return impl_->extent_world_m();
}
std::vector<std::string> ElevationFile::warnings() const { return impl_->warnings(); }
const std::string& ElevationFile::remedy() const { return impl_->place().remedy(); }

}  // namespace situation_awareness

// SPDX-License-Identifier: BSD-3-Clause
#include "situation_awareness/map/grid/geotiff.hpp"

#include <array>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <limits>
#include <stdexcept>
#include <vector>

#include "gdal_dataset.hpp"
#include "situation_awareness/common/file.hpp"

namespace situation_awareness {
namespace {

constexpr const char* kDescription = "situation_awareness grid";
/// Of the numbers of rows and columns from the world's origin.
constexpr double kMostCells = 1e9;

[[noreturn]] void refuse(const std::string& path, const std::string& reason) {
  throw std::runtime_error(path + ": " + reason + ": " + CPLGetLastErrorMsg());
}

/// Rows from the north to rows from the south, and back.
template <class To, class From>
std::vector<To> turned_over(const std::vector<From>& values, int width) {
  std::vector<To> turned;
  turned.reserve(values.size());
  const auto row = static_cast<std::size_t>(width);
  for (std::size_t begin = values.size(); begin >= row && begin > 0; begin -= row) {
    for (std::size_t i = begin - row; i < begin; ++i) turned.push_back(static_cast<To>(values[i]));
  }
  return turned;
}

}  // namespace

void save_geotiff(const std::string& path, const SemanticGrid& grid) {
  NewFile file(path, kind_with_mark("a grid", kDescription));
  const QuietGdal quiet;
  const bool is_empty = grid.width < 1 || grid.height < 1;
  const int width = is_empty ? 1 : grid.width, height = is_empty ? 1 : grid.height;
  if (static_cast<double>(width) * height > kMaxRasterCells || std::abs(grid.first_column) > kMostCells ||
      std::abs(grid.first_row) > kMostCells) {
    throw std::runtime_error(path + ": cannot be written: more cells than can be read");
  }
  std::vector<float> probability = turned_over<float>(grid.probability, width);
  std::vector<float> images = turned_over<float>(grid.images, width);
  probability.resize(static_cast<std::size_t>(width) * static_cast<std::size_t>(height),
                     std::numeric_limits<float>::quiet_NaN());
  images.resize(probability.size(), 0.0F);
  Dataset dataset(
      GDALCreate(GDALGetDriverByName("GTiff"), file.partial().c_str(), width, height, 2, GDT_Float32, nullptr));
  if (!dataset) refuse(path, "cannot be written");
  std::array<double, 6> transform{grid.first_column * grid.cell_m,         grid.cell_m, 0.0,
                                  (grid.first_row + height) * grid.cell_m, 0.0,         -grid.cell_m};
  bool is_done = GDALSetMetadataItem(dataset.get(), "TIFFTAG_IMAGEDESCRIPTION", kDescription, nullptr) == CE_None &&
                 GDALSetGeoTransform(dataset.get(), transform.data()) == CE_None;
  GDALSetRasterNoDataValue(GDALGetRasterBand(dataset.get(), 1), std::numeric_limits<double>::quiet_NaN());
  for (int band = 1; band <= 2; ++band) {
    is_done = is_done &&
              GDALRasterIO(GDALGetRasterBand(dataset.get(), band), GF_Write, 0, 0, width, height,
                           band == 1 ? probability.data() : images.data(), width, height, GDT_Float32, 0, 0) == CE_None;
  }
  dataset.reset();
  if (!is_done || CPLGetLastErrorType() >= CE_Failure) refuse(path, "cannot be written");
  file.finish();
}

SemanticGrid load_geotiff(const std::string& path) {
  const QuietGdal quiet;
  const Dataset dataset(GDALOpen(path.c_str(), GA_ReadOnly));
  if (!dataset) refuse(path, "cannot be read");
  const std::string defect = size_defect(dataset.get(), path);
  if (!defect.empty()) throw std::runtime_error(path + ": no grid: " + defect);
  SemanticGrid grid;
  grid.width = GDALGetRasterXSize(dataset.get());
  grid.height = GDALGetRasterYSize(dataset.get());
  std::array<double, 6> transform{};
  const bool has_transform = GDALGetGeoTransform(dataset.get(), transform.data()) == CE_None;
  grid.cell_m = transform[1];
  const double column = transform[0] / grid.cell_m, row = transform[3] / grid.cell_m - grid.height;
  const bool fits = has_transform && GDALGetRasterCount(dataset.get()) >= 2 && grid.cell_m > 0.0 &&
                    transform[5] == -grid.cell_m && transform[2] == 0.0 && transform[4] == 0.0 &&
                    std::abs(column) <= kMostCells && std::abs(row) <= kMostCells &&
                    std::abs(column - std::round(column)) < 1e-6 && std::abs(row - std::round(row)) < 1e-6;
  if (!fits) throw std::runtime_error(path + ": no grid: not two bands of square cells on multiples of their size");
  grid.first_column = static_cast<int>(std::lround(column));
  grid.first_row = static_cast<int>(std::lround(row));
  std::vector<float> values(static_cast<std::size_t>(grid.width) * static_cast<std::size_t>(grid.height));
  for (int band = 1; band <= 2; ++band) {
    if (GDALRasterIO(GDALGetRasterBand(dataset.get(), band), GF_Read, 0, 0, grid.width, grid.height, values.data(),
                     grid.width, grid.height, GDT_Float32, 0, 0) != CE_None) {
      refuse(path, "cannot be read");
    }
    for (const float value : values) {
      const bool is_probability = std::isnan(value) || (value >= 0.0F && value <= 1.0F);
      const bool is_count = value >= 0.0F && value < 2e9F;
      if (!(band == 1 ? is_probability : is_count)) {
        throw std::runtime_error(path + ": no grid: band " + std::to_string(band) + " has " + std::to_string(value));
      }
    }
    if (band == 1) {
      grid.probability = turned_over<float>(values, grid.width);
    } else {
      grid.images = turned_over<std::int32_t>(values, grid.width);
    }
  }
  grid.class_images.assign(values.size(), 0);
  grid.class_latest.assign(values.size(), 0);
  grid.ground_world_m.assign(values.size(), std::numeric_limits<float>::quiet_NaN());
  return grid;
}

}  // namespace situation_awareness

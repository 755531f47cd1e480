// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstdint>
#include <filesystem>
#include <memory>
#include <string>
#include <system_error>

#include <cpl_error.h>
#include <gdal.h>

namespace situation_awareness {

struct CloseDataset {
  void operator()(void* dataset) const { GDALClose(dataset); }
};
using Dataset = std::unique_ptr<void, CloseDataset>;

/// GDAL's messages go into the errors that are thrown, instead of stderr.
struct QuietGdal {
  QuietGdal() {
    GDALAllRegister();
    CPLPushErrorHandler(CPLQuietErrorHandler);
    CPLErrorReset();
  }
  QuietGdal(const QuietGdal&) = delete;
  QuietGdal& operator=(const QuietGdal&) = delete;
  ~QuietGdal() { CPLPopErrorHandler(); }
};

/// Of a raster that is read or written, at most: floats of 1 GiB.
constexpr double kMaxRasterCells = 1 << 28;
/// Cells of a GeoTIFF for each of its bytes, at most: deflate makes a thousandth of what is all the same.
constexpr double kMaxCellsPerByte = 1024.0;

/// Why a raster is too large for memory to be taken for it; empty if it is not. What a small file says of its size may
/// be wrong.
inline std::string size_defect(void* dataset, const std::string& path) {
  const double cells = static_cast<double>(GDALGetRasterXSize(dataset)) * GDALGetRasterYSize(dataset);
  if (cells > kMaxRasterCells) return "it has more than 2^28 pixels";
  const bool is_file = std::string(GDALGetDriverShortName(GDALGetDatasetDriver(dataset))) == "GTiff";
  std::error_code error;
  const std::uintmax_t bytes = std::filesystem::file_size(path, error);
  if (is_file && !error && cells > kMaxCellsPerByte * static_cast<double>(bytes)) {
    return "it says of " + std::to_string(bytes) + " bytes that they are more pixels than these can have";
  }
  return "";
}

}  // namespace situation_awareness

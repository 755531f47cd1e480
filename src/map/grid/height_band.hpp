// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstddef>
#include <optional>
#include <string>
#include <vector>

#include <gdal.h>

namespace situation_awareness {

/// The heights that a raster's first band has: what it says of its numbers (scale, offset, unit, mask, no data) is
/// heeded. Voids that it does not declare, such as -9999, are not known either where they are far off all others.
class HeightBand {
 public:
  /// `crs_unit_m`: of the heights where the band has no unit. Throws std::invalid_argument with what is wrong.
  HeightBand(GDALDatasetH dataset, double crs_unit_m);

  int columns() const { return columns_; }
  int rows() const { return rows_; }

  /// The middle of the known heights of some pixels all over the raster (m); NaN if none is known.
  double typical_m() const { return typical_m_; }

  /// The heights (m) of a part of the raster, rows as it has them, each the mean of the known ones of `merged` x
  /// `merged` pixels, NaN if none is. `width` and `height` are those of the result. Throws std::runtime_error with
  /// GDAL's reason.
  std::vector<float> read(int column, int row, int width, int height, int merged);

  /// Voids that were read and are not declared, in one sentence; empty if none was.
  std::string undeclared_voids() const;

 private:
  double metres(double stored, double mask);
  void read_stored(int column, int row, int width, int height);

  GDALRasterBandH band_, mask_ = nullptr;
  int columns_, rows_;
  double scale_ = 1.0, offset_ = 0.0, unit_m_ = 1.0, typical_m_;
  std::optional<float> no_data_;
  std::vector<double> stored_, known_;  ///< of the part that was read last
  double void_ = 0.0;                   ///< the latest that is not declared
  std::size_t voids_ = 0;
};

}  // namespace situation_awareness

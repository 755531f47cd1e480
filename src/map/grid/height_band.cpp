// SPDX-License-Identifier: BSD-3-Clause
#include "height_band.hpp"

#include <algorithm>
#include <array>
#include <cctype>
#include <cmath>
#include <cstdint>
#include <limits>
#include <stdexcept>
#include <utility>

#include <cpl_error.h>

namespace situation_awareness {
namespace {

constexpr double kUnknown = std::numeric_limits<double>::quiet_NaN();
/// What writers of elevations put where nothing is known.
constexpr std::array<double, 4> kVoids{-9999.0, -99999.0, -32768.0, -32767.0};
constexpr double kMostStored = 1e30;  ///< beyond it is a void, too: the largest floats are
constexpr double kFarOff_m = 500.0;   ///< a void from all else: no terrain in view has so deep a hole
constexpr int kSamples = 12;          ///< along each edge
constexpr std::size_t kAtOnce = 1 << 20;

/// The length (m) of a unit of heights by its name; nothing if it is none.
std::optional<double> unit_m(const std::string& name) {
  std::string letters;
  for (const char c : name) {
    if (std::isalpha(static_cast<unsigned char>(c)) != 0) {
      letters += static_cast<char>(std::tolower(static_cast<unsigned char>(c)));
    }
  }
  static const std::vector<std::pair<double, std::vector<const char*>>> kUnits = {
      {1.0, {"m", "metre", "metres", "meter", "meters"}},
      {0.3048, {"ft", "foot", "feet", "internationalfoot", "internationalfeet", "footinternational"}},
      {1200.0 / 3937.0,
       {"usft", "ftus", "sft", "usfoot", "footus", "ussurveyfoot", "ussurveyfeet", "surveyfoot", "surveyfeet"}},
      {0.1, {"dm", "decimetre", "decimetres", "decimeter", "decimeters"}},
      {0.01, {"cm", "centimetre", "centimetres", "centimeter", "centimeters"}},
      {0.001, {"mm", "millimetre", "millimetres", "millimeter", "millimeters"}},
      {1000.0, {"km", "kilometre", "kilometres", "kilometer", "kilometers"}}};
  for (const auto& [length_m, names] : kUnits) {
    if (std::find(names.begin(), names.end(), letters) != names.end()) return length_m;
  }
  return std::nullopt;
}

}  // namespace

HeightBand::HeightBand(GDALDatasetH dataset, double crs_unit_m)
    : band_(GDALGetRasterBand(dataset, 1)),
      columns_(GDALGetRasterXSize(dataset)),
      rows_(GDALGetRasterYSize(dataset)),
      unit_m_(crs_unit_m),
      typical_m_(kUnknown) {
  const GDALColorInterp colour = GDALGetRasterColorInterpretation(band_);
  if (colour == GCI_RedBand || colour == GCI_PaletteIndex) throw std::invalid_argument("its bands are colours");
  int is_given = 0;
  if (const double scale = GDALGetRasterScale(band_, &is_given); is_given != 0) scale_ = scale;
  if (const double offset = GDALGetRasterOffset(band_, &is_given); is_given != 0) offset_ = offset;
  if (!std::isfinite(scale_) || scale_ == 0.0 || !std::isfinite(offset_)) {
    throw std::invalid_argument("its band's scale is 0, or not finite, or its offset is not");
  }
  const char* const name = GDALGetRasterUnitType(band_);
  if (const std::string unit = name == nullptr ? "" : name; !unit.empty()) {
    const std::optional<double> length_m = unit_m(unit);
    if (!length_m) throw std::invalid_argument("its band's unit \"" + unit + "\" is none of heights");
    unit_m_ = *length_m;
  }
  const double no_data = GDALGetRasterNoDataValue(band_, &is_given);
  if (is_given != 0) no_data_ = static_cast<float>(no_data);
  const int flags = GDALGetMaskFlags(band_);
  if ((flags & (GMF_ALL_VALID | GMF_NODATA)) == 0) mask_ = GDALGetMaskBand(band_);

  std::vector<double> sample_m;
  for (int i = 0; i < kSamples * kSamples; ++i) {
    const auto middle = [](int k, int count) {
      return static_cast<int>((std::int64_t{2 * k + 1} * count) / std::int64_t{2 * kSamples});
    };
    read_stored(middle(i % kSamples, columns_), middle(i / kSamples, rows_), 1, 1);
    if (std::find(kVoids.begin(), kVoids.end(), stored_[0]) != kVoids.end()) continue;
    const double height_m = metres(stored_[0], known_[0]);
    if (!std::isnan(height_m)) sample_m.push_back(height_m);
  }
  if (sample_m.empty()) return;
  const auto middle = sample_m.begin() + static_cast<std::ptrdiff_t>(sample_m.size() / 2);
  std::nth_element(sample_m.begin(), middle, sample_m.end());
  typical_m_ = *middle;
  voids_ = 0;
}

void HeightBand::read_stored(int column, int row, int width, int height) {
  const auto count = static_cast<std::size_t>(width) * static_cast<std::size_t>(height);
  stored_.resize(count);
  known_.assign(count, 1.0);
  const auto read = [&](GDALRasterBandH band, std::vector<double>& values) {
    return GDALRasterIO(band, GF_Read, column, row, width, height, values.data(), width, height, GDT_Float64, 0, 0);
  };
  if (read(band_, stored_) != CE_None || (mask_ != nullptr && read(mask_, known_) != CE_None)) {
    throw std::runtime_error(std::string("its first band cannot be read (") + CPLGetLastErrorMsg() + ")");
  }
}

double HeightBand::metres(double stored, double known) {
  if (known == 0.0 || !std::isfinite(stored) || (no_data_ && static_cast<float>(stored) == *no_data_)) return kUnknown;
  const double height_m = (scale_ * stored + offset_) * unit_m_;
  const bool is_void = std::abs(stored) > kMostStored ||
                       (std::find(kVoids.begin(), kVoids.end(), stored) != kVoids.end() &&
                        !(std::abs(height_m - (std::isnan(typical_m_) ? 0.0 : typical_m_)) < kFarOff_m));
  if (!is_void) return height_m;
  void_ = stored;
  ++voids_;
  return kUnknown;
}

std::vector<float> HeightBand::read(int column, int row, int width, int height, int merged) {
  std::vector<float> heights(static_cast<std::size_t>(width) * static_cast<std::size_t>(height));
  const auto of_row = static_cast<std::size_t>(width) * static_cast<std::size_t>(merged * merged);
  const int at_once = std::max(1, static_cast<int>(kAtOnce / std::max(of_row, std::size_t{1})));
  for (int first = 0; first < height; first += at_once) {
    const int count = std::min(at_once, height - first);
    read_stored(column, row + first * merged, width * merged, count * merged);
    for (int r = 0; r < count; ++r) {
      for (int c = 0; c < width; ++c) {
        double sum_m = 0.0, known = 0.0;
        for (int i = 0; i < merged; ++i) {
          const std::size_t from = static_cast<std::size_t>(r * merged + i) * static_cast<std::size_t>(width * merged) +
                                   static_cast<std::size_t>(c * merged);
          for (std::size_t j = from; j < from + static_cast<std::size_t>(merged); ++j) {
            const double height_m = metres(stored_[j], known_[j]);
            if (std::isnan(height_m)) continue;
            sum_m += height_m;
            known += 1.0;
          }
        }
        heights[static_cast<std::size_t>(first + r) * static_cast<std::size_t>(width) + static_cast<std::size_t>(c)] =
            static_cast<float>(sum_m / known);  // NaN where none is known
      }
    }
  }
  return heights;
}

std::string HeightBand::undeclared_voids() const {
  if (voids_ == 0) return "";
  std::string value = std::to_string(void_);
  if (const auto point = value.find('.'); point != std::string::npos) value.resize(point);
  return "its value " + (std::abs(void_) > kMostStored ? "beyond 1e30" : value) + " (" + std::to_string(voids_) +
         " pixels) is taken for unknown, though it is not declared as no data";
}

}  // namespace situation_awareness

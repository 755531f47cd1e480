// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <algorithm>
#include <cmath>
#include <cstdint>

namespace situation_awareness {

/// Red, green and blue in [0, 1].
struct Color {
  float r, g, b;
};

constexpr Color kStructureColor{0.55F, 0.55F, 0.55F};
constexpr Color kNoIdColor{0.1F, 0.1F, 0.1F};         // hits on an object that has no id yet
constexpr Color kRefusedColor{0.5F, 0.0F, 0.0F};      // hits on what may be an object, but has no detection
constexpr Color kNoSegmentColor{0.65F, 0.5F, 0.25F};  // hits in no segment
constexpr Color kUncertaintyColor{0.85F, 0.1F, 0.1F};
constexpr Color kStandingColor{0.12F, 0.42F, 0.82F};
constexpr Color kMovingColor{0.97F, 0.48F, 0.04F};
constexpr Color kUnknownClassColor{0.5F, 0.55F, 0.6F};
constexpr Color kPersonColor{0.93F, 0.46F, 0.1F};
constexpr Color kVehicleColor{0.12F, 0.42F, 0.82F};
constexpr Color kPoleColor{0.2F, 0.6F, 0.3F};

/// A saturated colour for each number, distinct from its neighbours': hues advance by the golden ratio.
inline Color color_of(std::uint64_t number) {
  constexpr double kGoldenRatioMinusOne = 0.61803398874989484820;
  constexpr double kSaturation = 0.85, kValue = 0.9;
  const double hue = std::fmod(static_cast<double>(number % 100'000) * kGoldenRatioMinusOne, 1.0);
  const auto channel = [hue](double offset) {
    const double k = std::fmod(offset + 6.0 * hue, 6.0);
    return static_cast<float>(kValue - kValue * kSaturation * std::clamp(std::min(k, 4.0 - k), 0.0, 1.0));
  };
  return {channel(5.0), channel(3.0), channel(1.0)};
}

/// In the format of the field `rgb` of a PointCloud2.
inline std::uint32_t packed_rgb(const Color& color) {
  const auto byte = [](float channel) { return static_cast<std::uint32_t>(std::lround(255.0F * channel)); };
  return byte(color.r) << 16 | byte(color.g) << 8 | byte(color.b);
}

}  // namespace situation_awareness

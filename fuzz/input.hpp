// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <fuzzer/FuzzedDataProvider.h>

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <cstdio>
#include <cstdlib>
#include <cstring>
#include <string>
#include <variant>
#include <vector>

#include <Eigen/Geometry>

#include "situation_awareness/common/params.hpp"
#include "situation_awareness/geometry/angles.hpp"
#include "situation_awareness/geometry/ellipse.hpp"
#include "situation_awareness/geometry/pose2.hpp"

namespace situation_awareness::fuzz {

/// A property that must hold for every input. Unlike assert, in every build; libFuzzer keeps the input.
inline void require(bool truth, const char* property) {
  if (truth) return;
  std::fprintf(stderr, "broken property: %s\n", property);
  std::abort();
}

/// Values drawn from the fuzzer's bytes.
class Input {
 public:
  Input(const std::uint8_t* data, std::size_t size) : bytes_(data, size) {}

  bool flag() { return bytes_.ConsumeBool(); }
  int integer(int low, int high) { return bytes_.ConsumeIntegralInRange(low, high); }
  std::size_t count(std::size_t most) { return bytes_.ConsumeIntegralInRange<std::size_t>(0, most); }
  std::int64_t any_int64() { return bytes_.ConsumeIntegral<std::int64_t>(); }
  bool left() { return bytes_.remaining_bytes() > 0; }
  std::string rest() { return bytes_.ConsumeRemainingBytesAsString(); }

  /// Any bit pattern: NaN, infinities and denormals too.
  template <class Real>
  Real any() {
    Real value = 0;
    const std::vector<std::uint8_t> bits = bytes_.ConsumeBytes<std::uint8_t>(sizeof value);
    if (bits.size() == sizeof value) std::memcpy(&value, bits.data(), sizeof value);
    return value;
  }

  double uniform(double low, double high) { return bytes_.ConsumeFloatingPointInRange(low, high); }

  /// In [low, high], low > 0, as often of one magnitude as of another.
  double by_magnitude(double low, double high) { return std::exp(uniform(std::log(low), std::log(high))); }

  /// Of either sign or zero, up to `most`, of any magnitude down to a billionth of it.
  double signed_by_magnitude(double most) {
    switch (integer(0, 2)) {
      case 0:
        return 0.0;
      case 1:
        return by_magnitude(1e-9 * most, most);
      default:
        return -by_magnitude(1e-9 * most, most);
    }
  }

  /// Mostly in the range of scanners, sometimes any finite number up to `most`.
  double coordinate(double usual, double most) { return flag() ? uniform(-usual, usual) : signed_by_magnitude(most); }

  Pose2 pose2() {
    const double x_m = coordinate(10.0, 1e6);
    const double y_m = coordinate(10.0, 1e6);
    return {{x_m, y_m}, coordinate(kPi, 1e3)};
  }

  /// rx >= ry > 0.
  Ellipse ellipse() {
    Ellipse ellipse;
    ellipse.center_m.x() = coordinate(10.0, 1e4);
    ellipse.center_m.y() = coordinate(10.0, 1e4);
    ellipse.psi_rad = coordinate(kPi, 100.0);
    ellipse.rx_m = flag() ? uniform(0.05, 0.5) : by_magnitude(1e-6, 1e3);
    ellipse.ry_m = ellipse.rx_m * (flag() ? 1.0 : by_magnitude(1e-6, 1.0));
    return ellipse;
  }

 private:
  FuzzedDataProvider bytes_;
};

inline void draw(Input& input, double& value, Bounds bounds) {
  switch (input.integer(0, 7)) {
    case 0:
      value = input.uniform(bounds.low, bounds.high);
      break;
    case 1:
      value = std::clamp(value * input.by_magnitude(0.1, 10.0), bounds.low, bounds.high);
      break;
    case 2:
      value = input.flag() ? bounds.low : bounds.high;
      break;
    default:
      break;
  }
}

inline void draw(Input& input, int& value, Bounds bounds) {
  if (input.integer(0, 3) != 0) return;
  value = input.integer(static_cast<int>(bounds.low), static_cast<int>(bounds.high));
}

/// Draws some numbers of a params struct within their bounds.
template <class Params>
Params draw_params(Input& input) {
  Params params;
  if (!input.flag()) return params;
  for (const Parameter& parameter : parameters_of(params)) {
    if (auto* const* real = std::get_if<double*>(&parameter.value)) draw(input, **real, *parameter.bounds);
    if (auto* const* whole = std::get_if<int*>(&parameter.value)) draw(input, **whole, *parameter.bounds);
  }
  return params;
}

}  // namespace situation_awareness::fuzz

// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstdint>

#include <Eigen/Core>

#include "situation_awareness/common/random.hpp"

namespace situation_awareness {

/// A separate seed for each scan of a sensor, so that its noise does not depend on other scans: SplitMix64 (Steele,
/// Lea, Flood, 2014).
inline std::uint64_t seed_of_scan(std::uint64_t seed, std::uint64_t scan) {
  const auto mix = [](std::uint64_t z) {
    z += 0x9E3779B97F4A7C15U;
    z = (z ^ (z >> 30)) * 0xBF58476D1CE4E5B9U;
    z = (z ^ (z >> 27)) * 0x94D049BB133111EBU;
    return z ^ (z >> 31);
  };
  return mix(mix(seed) + scan);
}

/// Three standard normal numbers.
inline Eigen::Vector3d normal3(Random& random) {
  const double x = random.normal(), y = random.normal(), z = random.normal();  // in this order
  return {x, y, z};
}

/// Combined with a sensor's seed for the noise of its intensities, so that it does not change the ranges.
constexpr std::uint64_t kIntensityStream = 0x696E74656E736974U;

/// The same for the errors of a scanner other than the noise of its ranges.
constexpr std::uint64_t kErrorStream = 0x7363616E6E657273U;

}  // namespace situation_awareness

// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstddef>
#include <limits>

#include "situation_awareness/common/random.hpp"

namespace situation_awareness {

/// Valid, odd and hostile, by turns.
inline double odd_number(Random& random) {
  constexpr double kNan = std::numeric_limits<double>::quiet_NaN(), kInf = std::numeric_limits<double>::infinity();
  constexpr double kOdd[] = {0.0, -0.0, 1.0, -1.0, 1e-300, 1e-9, 1e5, 1e9, 1e155, -1e300, kNan, kInf, -kInf};
  return kOdd[static_cast<std::size_t>(random.uniform(0.0, 13.0)) % 13];
}

}  // namespace situation_awareness

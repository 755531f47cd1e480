// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstdint>

namespace situation_awareness {

/// Time is an integer count of nanoseconds everywhere in the core: it is an argument, never read from a clock.
constexpr std::int64_t kNanosecondsPerSecond = 1'000'000'000;

/// Seconds from `from_ns` to `to_ns`, exact to double precision for any two stamps.
inline double seconds_between(std::int64_t from_ns, std::int64_t to_ns) {
  // Their difference need not fit into a signed number.
  const auto from = static_cast<std::uint64_t>(from_ns);
  const auto to = static_cast<std::uint64_t>(to_ns);
  return to_ns >= from_ns ? static_cast<double>(to - from) * 1e-9 : -static_cast<double>(from - to) * 1e-9;
}

inline std::int64_t nanoseconds(double seconds) {
  return static_cast<std::int64_t>(seconds * 1e9 + (seconds < 0.0 ? -0.5 : 0.5));
}

}  // namespace situation_awareness

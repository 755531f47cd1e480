// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstdint>

namespace situation_awareness {

/// What the calling thread has asked the heap for since it began, by operator new, by malloc and its relatives, in this
/// program and in every library it uses: allocations.cpp stands in for them wherever it is linked (glibc alone).
struct Allocations {
  std::int64_t count = 0;
  std::int64_t bytes = 0;  ///< asked for, not what was given back
};

Allocations allocations();

inline Allocations operator-(const Allocations& a, const Allocations& b) {
  return {a.count - b.count, a.bytes - b.bytes};
}

}  // namespace situation_awareness

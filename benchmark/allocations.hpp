// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstdint>

namespace situation_awareness {

/// Heap allocations of the calling thread since its start, by operator new and malloc and its variants, in this program
/// and all its libraries: allocations.cpp replaces them where it is linked (glibc only).
struct Allocations {
  std::int64_t count = 0;
  std::int64_t bytes = 0;  ///< allocated, without deallocations
};

Allocations allocations();

inline Allocations operator-(const Allocations& a, const Allocations& b) {
  return {a.count - b.count, a.bytes - b.bytes};
}

}  // namespace situation_awareness

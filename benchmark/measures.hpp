// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <malloc.h>
#include <unistd.h>

#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <fstream>
#include <stdexcept>
#include <vector>

#include "support/thread_cpu.hpp"

namespace situation_awareness {

/// Of the process: resident memory, and allocated heap memory.
struct Memory {
  std::int64_t resident_bytes = 0, heap_bytes = 0;
};

inline Memory memory() {
  Memory memory;
  std::ifstream file("/proc/self/statm");
  std::int64_t pages = 0;
  if (!(file >> pages >> pages)) throw std::runtime_error("/proc/self/statm: cannot be read");
  memory.resident_bytes = pages * sysconf(_SC_PAGESIZE);
  const struct mallinfo2 heap = mallinfo2();
  memory.heap_bytes = static_cast<std::int64_t>(heap.uordblks + heap.hblkhd);
  return memory;
}

/// Times of one block, in preallocated memory.
class Times {
 public:
  explicit Times(std::int64_t most) : us_(static_cast<std::size_t>(most), 1.0) {}

  void add(double us) { us_[count_++] = us; }
  void clear() { count_ = 0; }

  /// Quantile of the times.
  double quantile(double part) {
    if (count_ == 0) return 0.0;
    const auto nth = us_.begin() + static_cast<std::ptrdiff_t>(part * static_cast<double>(count_ - 1) + 0.5);
    std::nth_element(us_.begin(), nth, us_.begin() + static_cast<std::ptrdiff_t>(count_));
    return *nth;
  }

 private:
  std::vector<double> us_;
  std::size_t count_ = 0;
};

inline double median(std::vector<double> values) {
  const auto middle = values.begin() + static_cast<std::ptrdiff_t>(values.size() / 2);
  std::nth_element(values.begin(), middle, values.end());
  return *middle;
}

}  // namespace situation_awareness

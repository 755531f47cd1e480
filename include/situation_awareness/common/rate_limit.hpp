// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstdint>

#include "situation_awareness/common/time.hpp"

namespace situation_awareness {

/// Limits events of any timing to `rate_hz`: in any time T at most 2 + T * rate_hz pass, since one passes per period.
class RateLimit {
 public:
  /// `rate_hz` > 0.
  explicit RateLimit(double rate_hz) : period_ns_(nanoseconds(1.0 / rate_hz)) {}

  /// Whether the event at `now_ns` passes. Times of a monotonic clock.
  bool passes(std::int64_t now_ns) {
    if (started_ && now_ns < next_ns_) return false;
    // A late event does not shift the later periods, so that 20 Hz become 6 Hz and not 5 Hz.
    const bool on_time = started_ && now_ns < next_ns_ + period_ns_;
    next_ns_ = (on_time ? next_ns_ : now_ns) + period_ns_;
    started_ = true;
    return true;
  }

 private:
  std::int64_t period_ns_;
  std::int64_t next_ns_ = 0;
  bool started_ = false;
};

}  // namespace situation_awareness

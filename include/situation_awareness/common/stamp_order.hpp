// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstdint>
#include <limits>

#include "situation_awareness/common/time.hpp"

namespace situation_awareness {

/// Judges whether a scan may follow those before it. Stamps grow; one that goes far back is a new beginning (a bag that
/// loops, a simulation that starts again), one that goes back a little is not to be used.
class StampOrder {
 public:
  static constexpr std::int64_t kNone = std::numeric_limits<std::int64_t>::min();

  enum class Verdict { kNext, kRestart, kRefused };

  explicit StampOrder(double reset_time_jump_s) : reset_time_jump_s_(reset_time_jump_s) {}

  /// For the stamps to come.
  void set_reset_time_jump_s(double reset_time_jump_s) { reset_time_jump_s_ = reset_time_jump_s; }

  Verdict judge(std::int64_t stamp_ns) {
    Verdict verdict = Verdict::kNext;
    if (stamp_ns <= latest_ns_) {
      verdict = seconds_between(stamp_ns, latest_ns_) > reset_time_jump_s_ ? Verdict::kRestart : Verdict::kRefused;
    }
    if (verdict != Verdict::kRefused) latest_ns_ = stamp_ns;
    return verdict;
  }

  /// The latest that was not refused, kNone before the first.
  std::int64_t latest_ns() const { return latest_ns_; }

 private:
  double reset_time_jump_s_;
  std::int64_t latest_ns_ = kNone;
};

}  // namespace situation_awareness

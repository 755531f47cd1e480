// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstdint>
#include <limits>

#include "situation_awareness/common/time.hpp"

namespace situation_awareness {

/// Checks the order of stamps. They increase; a jump far back is a restart (a bag that loops, a simulation that is
/// restarted), a stamp that goes back a little is refused.
class StampOrder {
 public:
  static constexpr std::int64_t kNone = std::numeric_limits<std::int64_t>::min();

  enum class Verdict { kNext, kRestart, kRefused };

  explicit StampOrder(double reset_time_jump_s) : reset_time_jump_s_(reset_time_jump_s) {}

  /// Applies to later stamps.
  void set_reset_time_jump_s(double reset_time_jump_s) { reset_time_jump_s_ = reset_time_jump_s; }

  Verdict judge(std::int64_t stamp_ns) {
    Verdict verdict = Verdict::kNext;
    if (stamp_ns <= latest_ns_) {
      verdict = seconds_between(stamp_ns, latest_ns_) > reset_time_jump_s_ ? Verdict::kRestart : Verdict::kRefused;
    }
    if (verdict != Verdict::kRefused) latest_ns_ = stamp_ns;
    return verdict;
  }

  /// The latest accepted stamp, kNone before the first.
  std::int64_t latest_ns() const { return latest_ns_; }

 private:
  double reset_time_jump_s_;
  std::int64_t latest_ns_ = kNone;
};

}  // namespace situation_awareness

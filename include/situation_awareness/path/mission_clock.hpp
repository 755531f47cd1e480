// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstdint>
#include <optional>

namespace situation_awareness {

/// The time that a mission has taken, by the stamps of its steps. It never goes back, and no single stamp moves it: one
/// that goes back, or ahead by more than kJump_s, counts when the next one follows it. Two in a row ahead tell that
/// steps were missing: that time went by. Two in a row back tell that time was set back: it goes on from there.
class MissionClock {
 public:
  /// s. Longest time between steps that are not checked by the next one.
  static constexpr double kJump_s = 1.0;

  /// ns since the first step.
  std::int64_t advance(std::int64_t stamp_ns) {
    constexpr auto kJump_ns = static_cast<std::int64_t>(1e9 * kJump_s);
    if (!last_ns_) last_ns_ = stamp_ns;
    const std::int64_t since_ns = stamp_ns - *last_ns_;
    const bool is_next = since_ns >= 0 && since_ns <= kJump_ns;
    const bool is_agreed = jump_ns_ && stamp_ns > *jump_ns_ && stamp_ns - *jump_ns_ <= kFollows * kJump_ns;
    if (is_next || is_agreed) {
      elapsed_ns_ += since_ns >= 0 ? since_ns : stamp_ns - *jump_ns_;
      last_ns_ = stamp_ns;
      jump_ns_.reset();
    } else {
      jump_ns_ = stamp_ns;
    }
    return elapsed_ns_;
  }

 private:
  static constexpr std::int64_t kFollows = 5;  ///< of steps that are seldom: so many jumps apart two agree

  std::optional<std::int64_t> last_ns_, jump_ns_;
  std::int64_t elapsed_ns_ = 0;
};

}  // namespace situation_awareness

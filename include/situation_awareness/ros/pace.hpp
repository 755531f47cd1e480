// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>

namespace situation_awareness {

/// How long a stage needs for a message, and so whether it has time for all that wait or for the newest alone.
class Pace {
 public:
  /// One more message took so long, by the steady clock.
  void handled(double duration_s);

  /// Median over the latest messages, so that one the system interrupted says nothing; 0 before the first.
  double duration_s() const;

  /// How many of `waiting` messages, the oldest first, to pass over: none if all can be handled before another one is
  /// due, all but the newest if not. They come as often as the stamps of the oldest and the newest say, not as often as
  /// they happened to arrive: transforms that come late set several scans free at once.
  std::size_t passed_over(std::size_t waiting, std::int64_t oldest_stamp_ns, std::int64_t newest_stamp_ns) const;

 private:
  std::array<double, 5> durations_s_{};  ///< the latest `count_`, in a ring
  std::size_t count_ = 0, next_ = 0;
};

}  // namespace situation_awareness

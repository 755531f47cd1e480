// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>

namespace situation_awareness {

/// Measures the processing time per message, to decide under load whether all waiting messages or only the newest are
/// processed.
class Pace {
 public:
  /// Add the processing time of a message, by the steady clock.
  void handled(double duration_s);

  /// Median over the latest messages, robust against interruptions by the system; 0 before the first.
  double duration_s() const;

  /// Number of `waiting` messages, the oldest first, to drop: none if all can be processed before the next one is due,
  /// else all but the newest. The period is by the stamps of the oldest and the newest, not by arrival: late transforms
  /// release several scans at once.
  std::size_t passed_over(std::size_t waiting, std::int64_t oldest_stamp_ns, std::int64_t newest_stamp_ns) const;

 private:
  std::array<double, 5> durations_s_{};  ///< the latest `count_`, in a ring
  std::size_t count_ = 0, next_ = 0;
};

}  // namespace situation_awareness

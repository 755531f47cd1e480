// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstdint>
#include <vector>

namespace situation_awareness {

/// The times between two sights of the same place that agreed. Poses of such a time belong together: what drifted did
/// so outside of it.
class ClosedLoops {
 public:
  /// Of the two sights, `from_ns` <= `to_ns`.
  void add(std::int64_t from_ns, std::int64_t to_ns);

  /// How much of the time from `from_ns` to `to_ns` is in no closed loop (s). 0 if `to_ns` is not after `from_ns`.
  double open_s(std::int64_t from_ns, std::int64_t to_ns) const;

 private:
  struct Span {
    std::int64_t from_ns, to_ns;
  };
  std::vector<Span> spans_;  ///< in order, apart from each other
};

}  // namespace situation_awareness

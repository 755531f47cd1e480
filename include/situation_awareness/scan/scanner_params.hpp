// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <string>

namespace situation_awareness {

/// How a driver fills its messages, where it is not as sensor_msgs/LaserScan and REP-117 say: parameters of the section
/// `scan` (docs/your_scanner.md has a table of drivers).
struct ScannerParams {
  std::string no_return = "range_max";
  std::string beam_order = "forward";
  std::string stamp_at = "first";

  template <class Self, class Visit>
  static void fields(Self& self, Visit&& visit) {
    visit("no_return", self.no_return,
          "what the driver sends for \"nothing there\": inf, also more than range_max; range_max, also that itself; "
          "zero or nan, also these, which are no information otherwise");
    visit("beam_order", self.beam_order,
          "forward: beams are measured in the order of the array; backward: the last one of the array first");
    visit("stamp_at", self.stamp_at,
          "the beam whose time the stamp is, in the order of their measurement: first, middle or last");
  }

  /// Throws std::invalid_argument naming field, value and what it may be.
  void validate() const;
};

}  // namespace situation_awareness

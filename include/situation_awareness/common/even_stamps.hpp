// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstddef>
#include <cstdint>
#include <optional>
#include <vector>

#include "situation_awareness/common/stamp_order.hpp"

namespace situation_awareness {

/// Spreads stamps that come in bunches over the time of the measurements. A sensor measures at a steady rate, while a
/// driver that reads several measurements at once, or a clock of coarse steps, gives them the same stamp, or stamps
/// that follow one another much faster than the measurements did. Where bunches are seen, stamps are put on the
/// straight line of stamp by number through the last one of each bunch, which is read when it was just measured; or
/// through the first one, where receipts show that the stamps were cut off. Other stamps stay as they are. Time and
/// memory are bounded.
class EvenStamps {
 public:
  EvenStamps() { latest_.reserve(kMost); }

  /// The stamp of the next measurement, in their order. `received_ns`: as StampOrder::judge.
  std::int64_t add(std::int64_t stamp_ns, std::int64_t received_ns = StampOrder::kNone);

  /// Whether the latest stamps come in bunches.
  bool is_bunched() const { return is_bunched_; }
  /// Whether they could be spread; where measurements are missing at random they cannot.
  bool is_spread() const { return line_.has_value(); }

 private:
  /// So many of the latest stamps are looked at.
  static constexpr std::size_t kMost = 512;

  struct Stamp {
    std::uint64_t number;
    std::int64_t stamp_ns, received_ns;
  };
  /// stamp = begin + period * (number - begin of numbers)
  struct Line {
    std::uint64_t number;
    std::int64_t begin_ns;
    double period_s;
    std::int64_t at(std::uint64_t other) const;
  };

  void look();
  std::optional<Line> through(bool lasts, double mean_s) const;
  bool is_after_receipts(const Line& line) const;
  void clear();

  std::vector<Stamp> latest_;
  std::uint64_t number_ = 0, looked_ = 0;
  double gap_s_ = 0.0;
  bool is_bunched_ = false;
  std::optional<Line> line_;
  std::int64_t given_ns_ = StampOrder::kNone;
};

}  // namespace situation_awareness

// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstddef>
#include <cstdint>
#include <vector>

#include "situation_awareness/ros/check/report.hpp"

namespace situation_awareness {

/// The stamps of a topic's messages, compared with each other and with the times at which they were received.
class StampStatistics {
 public:
  /// In the order of receipt.
  void add(std::int64_t stamp_ns, std::int64_t received_ns);

  std::size_t count() const { return stamps_ns_.size(); }
  /// From the first stamp to the last in the order of receipt; 0 without messages.
  std::int64_t first_ns() const { return stamps_ns_.empty() ? 0 : stamps_ns_.front(); }
  std::int64_t last_ns() const { return stamps_ns_.empty() ? 0 : stamps_ns_.back(); }

  /// Median time from stamp to stamp, of steps ahead; 0 with fewer than two of different stamps.
  double period_s() const;
  /// Median of receipt minus stamp; 0 without messages.
  double lag_s() const;

  /// Appends the number of messages, the rate, and what is unusual about the stamps.
  void report(TopicReport& report) const;

 private:
  std::vector<std::int64_t> stamps_ns_, lags_ns_;
  std::int64_t last_received_ns_ = 0;
  std::vector<double> waits_s_;  ///< from receipt to receipt
};

}  // namespace situation_awareness

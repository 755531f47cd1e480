// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <algorithm>
#include <cstdint>
#include <functional>
#include <limits>
#include <memory>
#include <utility>
#include <vector>

namespace situation_awareness {

/// Runs sensors of different rates in the order of their times.
class Schedule {
 public:
  /// `next_time_s`: when the sensor is due; `measure` advances it.
  void add(std::function<double()> next_time_s, std::function<void()> measure) {
    entries_.push_back({std::move(next_time_s), std::move(measure)});
  }

  /// What is due at 0 and every `period_s` after: `act(time_s)`.
  void add_every(double period_s, std::function<void(double)> act) {
    const auto count = std::make_shared<std::int64_t>(0);
    add([count, period_s] { return static_cast<double>(*count) * period_s; },
        [count, period_s, act = std::move(act)] {
          act(static_cast<double>(*count) * period_s);
          ++*count;
        });
  }

  /// When the next one is due; infinity without sensors.
  double next_time_s() const {
    double time_s = std::numeric_limits<double>::infinity();
    for (const Entry& entry : entries_) time_s = std::min(time_s, entry.next_time_s());
    return time_s;
  }

  /// Run the sensor that is due next; of several due at the same time the one that was added first.
  void step() {
    const double time_s = next_time_s();
    const auto due = std::find_if(entries_.begin(), entries_.end(),
                                  [time_s](const Entry& entry) { return entry.next_time_s() <= time_s; });
    if (due != entries_.end()) due->measure();
  }

 private:
  struct Entry {
    std::function<double()> next_time_s;
    std::function<void()> measure;
  };
  std::vector<Entry> entries_;
};

}  // namespace situation_awareness

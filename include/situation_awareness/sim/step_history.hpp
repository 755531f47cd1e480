// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <deque>
#include <stdexcept>
#include <string>

namespace situation_awareness {

/// The states of a motion that is integrated in steps, of the last seconds.
template <class State>
class StepHistory {
 public:
  static constexpr double kStep_s = 0.001;
  static constexpr double kKept_s = 5.0;  ///< more than any sensor looks back

  explicit StepHistory(const State& begin) : states_{begin} {}

  std::int64_t steps() const { return steps_; }

  /// Until when the motion is known.
  double time_s() const { return static_cast<double>(steps_) * kStep_s; }

  /// The steps that are missing until the first one that is not before `time_s`; a step that is a rounding error later
  /// is the same time.
  std::int64_t missing(double time_s) const {
    return std::max<std::int64_t>(0, static_cast<std::int64_t>(std::ceil(time_s / kStep_s - 1e-6)) - steps_);
  }

  const State& latest() const { return states_.back(); }

  /// The state of time 0; nullptr once it is forgotten.
  const State* begin() const {
    return steps_ + 1 == static_cast<std::int64_t>(states_.size()) ? &states_.front() : nullptr;
  }

  void push(const State& state) {
    states_.push_back(state);
    ++steps_;
    if (static_cast<double>(states_.size()) * kStep_s > kKept_s) states_.pop_front();
  }

  /// The states before and after a time, and the time since the one before; `after` is `before` at the latest. Throws
  /// std::out_of_range for times that are not known, and those before 0.
  struct Between {
    const State& before;
    const State& after;
    double since_s;
  };
  Between at(double time_s) const {
    const auto first = steps_ - static_cast<std::int64_t>(states_.size()) + 1;
    const double steps = time_s / kStep_s;
    const auto before = static_cast<std::int64_t>(std::floor(steps + 1e-6));
    if (!(before >= first && steps <= static_cast<double>(steps_) + 1e-6)) {
      throw std::out_of_range("the vehicle's pose at " + std::to_string(time_s) + " s is not known, only from " +
                              std::to_string(static_cast<double>(first) * kStep_s) + " s to " +
                              std::to_string(this->time_s()) + " s");
    }
    const State& state = states_[static_cast<std::size_t>(before - first)];
    if (before == steps_) return {state, state, 0.0};
    return {state, states_[static_cast<std::size_t>(before - first) + 1],
            std::max(0.0, steps - static_cast<double>(before)) * kStep_s};
  }

 private:
  std::int64_t steps_ = 0;
  std::deque<State> states_;  ///< of the last steps; the last one is that of `steps_`
};

}  // namespace situation_awareness

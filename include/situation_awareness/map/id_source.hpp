// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <algorithm>
#include <cstdint>
#include <stdexcept>
#include <string>

namespace situation_awareness {

/// Names a feature for good. Below 2^53, so that JSON and SQL keep it: the number of the robot that saw it first, in
/// the upper 13 bits, and a counter in the lower 40.
using FeatureId = std::uint64_t;

/// Gives the ids of all features of one map, whatever their kind: none twice.
class IdSource {
 public:
  static constexpr int kCounterBits = 40;
  static constexpr std::uint64_t kMostRobot = (std::uint64_t{1} << 13) - 1;

  /// Throws std::invalid_argument if `robot` is more than kMostRobot.
  explicit IdSource(std::uint64_t robot = 0) : next_((robot << kCounterBits) + 1) {
    if (robot > kMostRobot) {
      throw std::invalid_argument("robot = " + std::to_string(robot) + " is not in [0, " + std::to_string(kMostRobot) +
                                  "]");
    }
  }

  /// The number of the robot that gave an id.
  static std::uint64_t robot_of(FeatureId id) { return id >> kCounterBits; }

  /// Throws std::length_error after 10^12 ids.
  FeatureId next() {
    if (robot_of(next_ + 1) != robot_of(next_)) throw std::length_error("all ids of this robot are given");
    return next_++;
  }

  /// The id that next() gives: to be saved with the map.
  FeatureId upcoming() const { return next_; }

  /// After a map of this robot was loaded that was saved with this upcoming(): its ids are not given again. Ids of
  /// other robots are no concern of this one.
  void resume(FeatureId upcoming) {
    if (robot_of(upcoming) == robot_of(next_)) next_ = std::max(next_, upcoming);
  }

 private:
  FeatureId next_;
};

}  // namespace situation_awareness

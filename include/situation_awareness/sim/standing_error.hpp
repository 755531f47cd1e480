// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstdint>

#include "situation_awareness/common/random.hpp"

namespace situation_awareness {

/// The error of a sensor of one quantity, such as a compass or an altimeter: one that stays, and one of each reading,
/// both of the same standard deviation.
class StandingError {
 public:
  StandingError(double sigma, std::uint64_t seed) : sigma_(sigma), random_(seed), standing_(sigma * random_.normal()) {}

  double reading_of(double truth) { return truth + standing_ + sigma_ * random_.normal(); }

  /// The variance for a filter that takes errors as independent: over `averaged` readings it averages, but the error
  /// that these have in common stays.
  double variance(double averaged) const { return (1.0 + averaged) * sigma_ * sigma_; }

 private:
  double sigma_;
  Random random_;
  double standing_;
};

}  // namespace situation_awareness

// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include "situation_awareness/map/objects/object_filter.hpp"

namespace situation_awareness {

/// True if the state has no velocities, nor any uncertainty of them: the estimate of what stands.
inline bool has_no_rates(const ObjectEstimate& estimate) {
  using object_state::kVelocity;
  constexpr int kRates = 3;  // velocity and angular velocity, side by side
  return estimate.x.segment<kRates>(kVelocity).isZero(0.0) && estimate.P.middleRows<kRates>(kVelocity).isZero(0.0) &&
         estimate.P.middleCols<kRates>(kVelocity).isZero(0.0);
}

}  // namespace situation_awareness

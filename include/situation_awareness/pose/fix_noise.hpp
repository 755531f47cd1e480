// SPDX-License-Identifier: BSD-3-Clause
#pragma once

namespace situation_awareness {

/// What the error of a fix is made of: slow errors have `correlated_share` of its variance, and are forgotten with the
/// time constant `correlation_s`; the rest is white.
struct FixNoise {
  double correlated_share = 0.5;
  double correlation_s = 20.0;
};

}  // namespace situation_awareness

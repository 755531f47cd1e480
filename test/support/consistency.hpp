// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <gtest/gtest.h>

#include "situation_awareness/estimation/error_state_filter.hpp"
#include "situation_awareness/estimation/gating.hpp"
#include "support/covariance.hpp"

namespace situation_awareness {

/// Normalised estimation error squared (NEES): chi-square of the dimension of the error if the covariance is
/// consistent.
template <class State>
double nees(const Estimate<State>& estimate, const State& truth) {
  return mahalanobis2(Manifold<State>::local_coordinates(estimate.x, truth), estimate.P);
}

/// A sum of squared Mahalanobis distances of independent errors, with its number of degrees of freedom.
struct ChiSquareSum {
  double sum = 0.0;
  int degrees_of_freedom = 0;

  void add(double mahalanobis2, int degrees) {
    sum += mahalanobis2;
    degrees_of_freedom += degrees;
  }

  /// Whether the sum is within 99 % bounds.
  ::testing::AssertionResult is_consistent() const {
    const double low = chi_square_quantile(0.005, degrees_of_freedom);
    const double high = chi_square_quantile(0.995, degrees_of_freedom);
    if (degrees_of_freedom > 0 && low <= sum && sum <= high) return ::testing::AssertionSuccess();
    return ::testing::AssertionFailure() << sum << " is not in [" << low << ", " << high
                                         << "], where 99 % of sums with " << degrees_of_freedom
                                         << " degrees of freedom are";
  }
};

}  // namespace situation_awareness

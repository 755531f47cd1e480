// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <algorithm>
#include <cmath>

namespace situation_awareness {

// Where no source is named, none is recorded; the sensitivity of these was not measured.

/// Standard deviations beyond which an element's distance counts linearly (Huber).
constexpr double kHuberSigmas = 2.0;
/// Largest share of an element in chi^2 when fits are compared.
constexpr double kMostChi2 = 9.0;
/// Where arcs do not follow the boundary, residuals of neighbours are alike. That is so where the sum of their products
/// is more than so many of its standard deviations, and what they have in common is at least this (m).
constexpr double kMisfitSigmas = 4.0;
constexpr double kLeastMisfit_m = 0.01;
/// A residual counts up to so many standard deviations in a search for misfits.
constexpr double kMostSigmas = 3.0;

/// The weight of an element in a search for misfits. It is bounded, so that an element that is known better does not
/// hide a misfit.
inline double misfit_weight(double weight) { return std::min(weight, 1.0 / kLeastMisfit_m); }

/// Whether residuals have as much in common as those of a misfit, by sums over elements.
inline bool have_misfit_in_common(double products, double elements, double weights) {
  if (products < kMisfitSigmas * std::sqrt(elements)) return false;
  const double sigma_m = elements / std::max(weights, 1e-12);
  return std::sqrt(products / elements) * sigma_m > kLeastMisfit_m;
}

}  // namespace situation_awareness

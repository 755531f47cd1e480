// SPDX-License-Identifier: BSD-3-Clause
#include "situation_awareness/evaluation/gospa.hpp"

#include <algorithm>
#include <cmath>
#include <stdexcept>

#include "situation_awareness/estimation/assignment.hpp"

namespace situation_awareness {

Gospa gospa(const std::vector<Eigen::Vector2d>& truths_m, const std::vector<Eigen::Vector2d>& estimates_m,
            double cutoff_m, double p) {
  if (!(cutoff_m > 0.0)) throw std::invalid_argument("cutoff_m must be above 0");
  if (!(p >= 1.0)) throw std::invalid_argument("p must be at least 1");

  // With m pairs, c^p / 2 (missed + false) = c^p (truths - m) + c^p / 2 (estimates - truths): an unmatched truth costs
  // c^p.
  const double cost_alone = std::pow(cutoff_m, p);
  std::vector<Candidate> candidates;
  for (std::size_t i = 0; i < truths_m.size(); ++i) {
    for (std::size_t j = 0; j < estimates_m.size(); ++j) {
      const double distance_m = (truths_m[i] - estimates_m[j]).norm();
      if (distance_m < cutoff_m) {
        candidates.push_back({static_cast<int>(i), static_cast<int>(j), std::pow(distance_m, p) - cost_alone});
      }
    }
  }
  const auto truths = static_cast<int>(truths_m.size());
  const auto estimates = static_cast<int>(estimates_m.size());
  const std::vector<int> estimate_of = assign(truths, estimates, candidates);

  Gospa result;
  int matched = 0;
  for (std::size_t i = 0; i < truths_m.size(); ++i) {
    if (estimate_of[i] < 0) continue;
    ++matched;
    result.localization += std::pow((truths_m[i] - estimates_m[static_cast<std::size_t>(estimate_of[i])]).norm(), p);
  }
  result.missed = truths - matched;
  result.false_estimates = estimates - matched;
  result.distance_m =
      std::pow(result.localization + 0.5 * cost_alone * (result.missed + result.false_estimates), 1.0 / p);
  return result;
}

}  // namespace situation_awareness

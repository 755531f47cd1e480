// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <vector>

#include <Eigen/Core>

namespace situation_awareness {

/// The GOSPA distance of two sets of points, and its components.
struct Gospa {
  double distance_m = 0.0;
  double localization = 0.0;  ///< sum of the matched pairs' distances to the power p, m^p
  int missed = 0;             ///< truths without an estimate
  int false_estimates = 0;    ///< estimates without a truth
};

/// Generalized optimal sub-pattern assignment metric with alpha = 2 (Rahmathullah, Garcia-Fernandez, Svensson,
/// "Generalized optimal sub-pattern assignment metric", FUSION 2017, Proposition 1):
///
///     d = ( min over matchings of  sum of |x - y|^p over the pairs  +  c^p / 2 (missed + false) )^(1/p)
///
/// Points at `cutoff_m` (c) or farther apart are not matched. Throws std::invalid_argument unless c > 0 and p >= 1.
Gospa gospa(const std::vector<Eigen::Vector2d>& truths_m, const std::vector<Eigen::Vector2d>& estimates_m,
            double cutoff_m, double p = 2.0);

}  // namespace situation_awareness

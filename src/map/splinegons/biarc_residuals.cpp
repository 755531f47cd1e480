// SPDX-License-Identifier: BSD-3-Clause
#include "biarc_residuals.hpp"

#include <algorithm>
#include <cmath>

#include "residual_bounds.hpp"

namespace situation_awareness {
namespace {

// Where no source is named, none is recorded; the sensitivity of these was not measured.

/// Two neighbours that are off by so many standard deviations, and so far, are not followed either: the tip of a slim
/// column has few others. One alone is an outlier.
constexpr double kPairSigmas = 4.0, kLeastPair_m = 0.03;

}  // namespace

void sum_residuals(const BoundaryElements& elements, const BiarcChain& chain, std::vector<BiarcResiduals>& residuals) {
  residuals.assign(chain.biarcs(), {});
  double before = 0.0, before_m = 0.0;
  std::size_t biarc_before = chain.biarcs();
  for (std::size_t i = 0; i < elements.points_m.size(); ++i) {
    const std::size_t biarc = chain.arc_of[i] / 2;
    const double distance_m = chain.of_elements[i].distance_m;
    const double sigmas = std::clamp(distance_m * misfit_weight(elements.weights[i]), -kMostSigmas, kMostSigmas);
    BiarcResiduals& sums = residuals[biarc];
    if (biarc == biarc_before) sums.products += sigmas * before;
    const double pair_m = std::min(std::abs(distance_m), before_m);
    if (elements.follow_tips && i > 0 && pair_m * elements.weights[i] > kPairSigmas) {
      for (const std::size_t of : {biarc, biarc_before}) {
        residuals[of].pair_m = std::max(residuals[of].pair_m, pair_m);
      }
    }
    sums.elements += 1.0;
    sums.weights += misfit_weight(elements.weights[i]);
    sums.squares_m2 += distance_m * distance_m;
    if (sums.elements == 1.0) sums.first = i;
    sums.last = i;
    before = sigmas;
    before_m = std::abs(distance_m);
    biarc_before = biarc;
  }
}

bool is_misfit(const BiarcResiduals& sums) {
  return sums.pair_m > kLeastPair_m || have_misfit_in_common(sums.products, sums.elements, sums.weights);
}

}  // namespace situation_awareness

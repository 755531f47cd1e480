// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstddef>
#include <vector>

#include "biarc_chain.hpp"
#include "boundary_elements.hpp"

namespace situation_awareness {

/// Sums over the residuals of the elements of a biarc.
struct BiarcResiduals {
  double products = 0.0;  ///< of neighbours, in standard deviations
  double pair_m = 0.0;    ///< by how much two neighbours are off at most that noise does not explain
  double elements = 0.0, weights = 0.0, squares_m2 = 0.0;
  std::size_t first = 0, last = 0;
};

/// Sums the residuals of each biarc, with the products of neighbours' residuals.
void sum_residuals(const BoundaryElements& elements, const BiarcChain& chain, std::vector<BiarcResiduals>& residuals);

/// Whether a biarc does not follow the boundary.
bool is_misfit(const BiarcResiduals& sums);

}  // namespace situation_awareness

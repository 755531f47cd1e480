// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstddef>
#include <vector>

#include "biarc_chain.hpp"
#include "boundary_elements.hpp"

namespace situation_awareness {

/// The jumps of the curvature that are expected from arc to arc of a chain.
class ExpectedJumps {
 public:
  ExpectedJumps(const BoundaryElements& elements, BiarcChain& chain) : elements_(elements), chain_(chain) {}

  /// The expected jumps of the curvature: those of the fit, smoothed along the boundary, and a small one that does not
  /// matter; before there is a fit, such as may be anywhere. A piece between corners whose elements one arc meets as
  /// well has none. Computes the chain's residuals.
  void expect(bool first);

  /// The standard deviation of the jump at the begin of an arc.
  double sigma_1pm(std::size_t arc) const { return sigma_1pm_[arc]; }
  /// Number of the parameters of the fit that the elements determine.
  double parameters() const { return parameters_; }

 private:
  bool is_one_arc(std::size_t begin, std::size_t arcs) const;

  const BoundaryElements& elements_;
  BiarcChain& chain_;
  std::vector<double> sigma_1pm_;
  double parameters_ = 0.0;
  std::vector<std::size_t> first_of_, last_of_;  ///< elements of each arc
};

}  // namespace situation_awareness

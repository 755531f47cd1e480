// SPDX-License-Identifier: BSD-3-Clause
#include "situation_awareness/estimation/gating.hpp"

#include <boost/math/distributions/chi_squared.hpp>

namespace situation_awareness {

double chi_square_quantile(double probability, double degrees_of_freedom) {
  return boost::math::quantile(boost::math::chi_squared(degrees_of_freedom), probability);
}

}  // namespace situation_awareness

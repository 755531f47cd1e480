// SPDX-License-Identifier: BSD-3-Clause
#include "situation_awareness/estimation/gating.hpp"

#include <gtest/gtest.h>

#include <cmath>

#include "situation_awareness/common/random.hpp"

namespace situation_awareness::gating_test {
namespace {

TEST(ChiSquareQuantile, WithTwoDegreesOfFreedomIsTheExponentialOne) {
  for (const double p : {0.05, 0.5, 0.95, 0.999}) {
    EXPECT_NEAR(chi_square_quantile(p, 2.0), -2.0 * std::log1p(-p), 1e-9);
  }
}

TEST(ChiSquareQuantile, ContainsItsProbabilityOfSumsOfSquaredNormals) {
  Random random(8);
  const double gate = chi_square_quantile(0.95, 5.0);
  const int draws = 20000;
  int inside = 0;
  for (int i = 0; i < draws; ++i) {
    double sum = 0.0;
    for (int k = 0; k < 5; ++k) sum += std::pow(random.normal(), 2);
    if (sum <= gate) ++inside;
  }
  const double sigma = std::sqrt(0.95 * 0.05 / draws);
  EXPECT_NEAR(static_cast<double>(inside) / draws, 0.95, 4.0 * sigma);
}

}  // namespace
}  // namespace situation_awareness::gating_test

// SPDX-License-Identifier: BSD-3-Clause
#include "situation_awareness/evaluation/gospa.hpp"

#include <algorithm>
#include <cmath>
#include <limits>
#include <numeric>
#include <stdexcept>

#include <gtest/gtest.h>

#include "situation_awareness/common/random.hpp"

namespace situation_awareness::gospa_test {
namespace {

using Points = std::vector<Eigen::Vector2d>;

Points random_points(Random& random, int count) {
  Points points;
  for (int i = 0; i < count; ++i) points.emplace_back(random.uniform(0.0, 3.0), random.uniform(0.0, 3.0));
  return points;
}

/// The definition itself (Definition 1 with alpha = 2): all of the smaller set is assigned, at distances cut off at c.
double by_definition(Points a, Points b, double c, double p) {
  if (a.size() > b.size()) std::swap(a, b);
  std::vector<std::size_t> order(b.size());
  std::iota(order.begin(), order.end(), 0);
  double least = std::numeric_limits<double>::infinity();
  do {
    double sum = 0.5 * std::pow(c, p) * static_cast<double>(b.size() - a.size());
    for (std::size_t i = 0; i < a.size(); ++i) sum += std::pow(std::min((a[i] - b[order[i]]).norm(), c), p);
    least = std::min(least, sum);
  } while (std::next_permutation(order.begin(), order.end()));
  return std::pow(least, 1.0 / p);
}

TEST(Gospa, IsItsDefinitionOverAllAssignments) {
  Random random(3);
  for (int i = 0; i < 300; ++i) {
    const Points a = random_points(random, i % 5), b = random_points(random, i / 5 % 6);
    for (const double p : {1.0, 2.0}) {
      EXPECT_NEAR(gospa(a, b, 1.0, p).distance_m, by_definition(a, b, 1.0, p), 1e-12);
    }
  }
}

TEST(Gospa, CountsMissedAndFalseEstimates) {
  const Gospa result = gospa({{0, 0}, {5, 0}, {9, 0}}, {{0.3, 0.4}, {5, 3}}, 1.0);
  EXPECT_EQ(result.missed, 2);
  EXPECT_EQ(result.false_estimates, 1);
  EXPECT_NEAR(result.localization, 0.25, 1e-12);
  EXPECT_NEAR(result.distance_m, std::sqrt(0.25 + 0.5 * 3), 1e-12);
}

TEST(Gospa, IsAMetric) {
  Random random(4);
  for (int i = 0; i < 300; ++i) {
    const Points a = random_points(random, i % 4), b = random_points(random, i % 7), c = random_points(random, i % 5);
    const double ab = gospa(a, b, 0.8).distance_m;
    EXPECT_NEAR(ab, gospa(b, a, 0.8).distance_m, 1e-12);
    EXPECT_LE(ab, gospa(a, c, 0.8).distance_m + gospa(c, b, 0.8).distance_m + 1e-12);
    EXPECT_EQ(gospa(a, a, 0.8).distance_m, 0.0);
  }
}

TEST(Gospa, RefusesCutOffsAndPowersThatMakeNoMetric) {
  EXPECT_THROW(gospa({}, {}, 0.0), std::invalid_argument);
  EXPECT_THROW(gospa({}, {}, 1.0, 0.5), std::invalid_argument);
}

}  // namespace
}  // namespace situation_awareness::gospa_test

// SPDX-License-Identifier: BSD-3-Clause
#include "allocations.hpp"

#include <cstddef>
#include <cstdint>
#include <vector>

#include <gtest/gtest.h>

#include "map/splinegons/outlines.hpp"
#include "situation_awareness/map/splinegons/splinegon_fit.hpp"

namespace situation_awareness {
namespace {

// One fit for all boundaries: smooth, with corners, open and closed, from nothing and from the fit before.
TEST(Allocation, NoneForSplinegonsAfterWarmUp) {
  SplinegonFit fit{SplinegonFitParams()};
  struct Boundary {
    bool closed;
    std::vector<SplinegonElement> elements;
    std::vector<SplinegonVertex> vertices;
  };
  std::vector<Boundary> boundaries;
  Random random(1);
  for (const std::vector<Outline>& outlines : {smooth_outlines(), cornered_outlines()}) {
    for (const Outline& outline : outlines) {
      boundaries.push_back({true, elements_of(outline, 0.15, 0.01, random), {}});
      boundaries.push_back({false, elements_of(outline, 0.15, 0.01, random, 0.1, 0.5), {}});
    }
  }
  std::int64_t asked = 0;
  for (int round = 0; round < 4; ++round) {
    const std::int64_t before = allocations().count;
    for (Boundary& boundary : boundaries) {
      if (round % 2 == 0) boundary.vertices.clear();
      fit.fit(boundary.elements, boundary.closed, 1e-4, boundary.vertices);
    }
    asked = allocations().count - before;
  }
  EXPECT_EQ(asked, 0);
}

}  // namespace
}  // namespace situation_awareness

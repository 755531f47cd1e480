// SPDX-License-Identifier: BSD-3-Clause
#include "allocations.hpp"

#include <cstddef>
#include <cstdint>
#include <vector>

#include <gtest/gtest.h>

#include "map/splinegons/outlines.hpp"
#include "situation_awareness/map/splinegons/splinegon_fit.hpp"
#include "situation_awareness/map/splinegons/splinegon_map.hpp"

namespace situation_awareness::map_splinegons_allocation_test {
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
      fit.fit(boundary.elements, boundary.closed, boundary.vertices);
    }
    asked = allocations().count - before;
  }
  EXPECT_EQ(asked, 0);
}

// Closed, open, and within the closed one, which is left out.
TEST(Allocation, NoneForAMapOfSplinegonsAfterWarmUp) {
  SplinegonMap map{SplinegonMapParams(), SplinegonFitParams()};
  Random random(2);
  const Outline outline = smooth_outlines().front();
  std::vector<ObstacleBoundary> boundaries(3);
  boundaries[0].elements = boundaries[1].elements = elements_of(outline, 0.15, 0.01, random, 0.1, 0.5);
  for (SplinegonElement& element : boundaries[0].elements) element.p_world_m *= 0.9;
  for (SplinegonElement& element : boundaries[1].elements) element.p_world_m.x() += 50.0;
  boundaries[2].elements = elements_of(outline, 0.15, 0.01, random);
  boundaries[2].closed = true;
  std::int64_t asked = 0;
  for (int scan = 1; scan <= 4; ++scan) {
    for (std::size_t i = 0; i < boundaries.size(); ++i) {
      boundaries[i].id = i + 1;
      boundaries[i].last_seen_ns = scan;
    }
    const std::int64_t before = allocations().count;
    ASSERT_EQ(map.update(scan, boundaries).boundaries.size(), 2U);
    asked = allocations().count - before;
  }
  EXPECT_EQ(asked, 0);
}

}  // namespace
}  // namespace situation_awareness::map_splinegons_allocation_test

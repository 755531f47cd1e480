// SPDX-License-Identifier: BSD-3-Clause
#include "situation_awareness/path/vehicle.hpp"

#include <gtest/gtest.h>

#include <string>
#include <vector>

#include "situation_awareness/common/params_yaml.hpp"
#include "situation_awareness/common/random.hpp"
#include "situation_awareness/geometry/box.hpp"
#include "support/refusal.hpp"

namespace situation_awareness::vehicle_test {
namespace {

std::string refused(const std::string& yaml) {
  return refusal_of([&] { params_from_yaml<VehicleParams>(yaml, "my.yaml"); });
}

TEST(Vehicle, DefaultsAreValidAndReadBack) {
  const VehicleParams params;
  EXPECT_NO_THROW(params.validate());
  const auto read = params_from_yaml<VehicleParams>(yaml_from_params(params), "text");
  EXPECT_EQ(read.footprint.corners_m, params.footprint.corners_m);
}

TEST(Vehicle, RefusesFootprintsThatAreNone) {
  EXPECT_TRUE(names(refused("footprint: 3"), {"my.yaml", "footprint", "[x, y]"}));
  EXPECT_TRUE(names(refused("footprint: [[1, 0], [0, 1]]"), {"vehicle.footprint", "3"}));
  EXPECT_TRUE(names(refused("footprint: [[1, 1], [1, -1], [-1, -1], [-1, 1]]"), {"vehicle.footprint", "convex"}));
  EXPECT_TRUE(names(refused("footprint: [[1, 1], [0.1, 0.1], [-1, 1], [-1, -1], [1, -1]]"), {"vehicle.footprint"}));
  EXPECT_TRUE(names(refused("footprint: [[2, 1], [1, 1], [1, -1], [2, -1]]"), {"vehicle.footprint"}));
  EXPECT_TRUE(names(refused("footprint: [[.nan, 1], [-1, 1], [-1, -1], [1, -1]]"), {"vehicle.footprint", "20"}));
  // A star goes round twice.
  EXPECT_FALSE(refused("footprint: [[1, 0], [-0.8, 0.59], [0.3, -0.95], [0.3, 0.95], [-0.8, -0.59]]").empty());
  EXPECT_TRUE(names(refused("slowing_m_s2: 2"), {"vehicle.slowing_m_s2", "vehicle.braking_m_s2"}));
  EXPECT_TRUE(names(refused("reaction_s: -1"), {"vehicle.reaction_s", "-1"}) ||
              names(refused("reaction_s: -1"), {"reaction_s", "-1"}));
}

TEST(Vehicle, ClearanceIsThatOfABox) {
  const Footprint footprint{{{0.3, 0.2}, {-0.3, 0.2}, {-0.3, -0.2}, {0.3, -0.2}}};
  const Box box{{0.0, 0.0}, 0.0, 0.3, 0.2};
  Random random(1);
  for (int i = 0; i < 1000; ++i) {
    const Eigen::Vector2d p(random.uniform(-1.0, 1.0), random.uniform(-1.0, 1.0));
    EXPECT_NEAR(clearance_m(footprint, p), std::max(offset_m(box, p), 0.0), 1e-12);
  }
  EXPECT_NEAR(reach_m(footprint), std::hypot(0.3, 0.2), 1e-12);
}

}  // namespace
}  // namespace situation_awareness::vehicle_test

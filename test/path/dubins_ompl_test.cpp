// SPDX-License-Identifier: BSD-3-Clause
// Against OMPL's Dubins paths, of equal radii.
#include <gtest/gtest.h>
#include <ompl/base/ScopedState.h>
#include <ompl/base/spaces/DubinsStateSpace.h>

#include <algorithm>
#include <cmath>
#include <memory>

#include "path/dubins_paths.hpp"

namespace situation_awareness {
namespace {

using ompl::base::DubinsStateSpace;

class Oracle {
 public:
  double length_m(const DubinsEnd& from, const DubinsEnd& to) const {
    const DubinsStateSpace space(from.radius_m);
    return from.radius_m * space.dubins(set(space, from).get(), set(space, to).get()).length();
  }

 private:
  struct Deleter {
    const DubinsStateSpace* space;
    void operator()(ompl::base::State* state) const { space->freeState(state); }
  };

  static std::unique_ptr<ompl::base::State, Deleter> set(const DubinsStateSpace& space, const DubinsEnd& end) {
    std::unique_ptr<ompl::base::State, Deleter> state(space.allocState(), Deleter{&space});
    auto* se2 = state->as<DubinsStateSpace::StateType>();
    se2->setXY(end.p_m.x(), end.p_m.y());
    se2->setYaw(wrap_to_pi(*end.yaw_rad));
    return state;
  }
};

TEST(DubinsAgainstOmpl, NeverLonger) {
  Random random(1);
  const Oracle oracle;
  double longest_m = 0.0, greatest_gap_of_all = 0.0;
  int three_turns = 0;
  for (int i = 0; i < 100'000; ++i) {
    const double radius_m = std::exp(random.uniform(-1.0, 2.0));
    const double size_m = radius_m * (i % 2 == 0 ? 2.0 : 15.0);
    const DubinsEnd from = random_end(random, size_m, radius_m), to = random_end(random, size_m, radius_m);
    const DubinsPath path = shortest_dubins_path(from, to);
    const double oracle_m = oracle.length_m(from, to);
    longest_m = std::max(longest_m, path.length_m - oracle_m);
    EXPECT_NEAR(path.length_m, oracle_m, 1e-9) << i;
    greatest_gap_of_all = std::max(greatest_gap_of_all, greatest_gap(path, from, to));
    three_turns += path.word == DubinsWord::kLrl || path.word == DubinsWord::kRlr ? 1 : 0;
  }
  EXPECT_LT(longest_m, 1e-9);
  EXPECT_LT(greatest_gap_of_all, 1e-9);
  EXPECT_GT(three_turns, 10'000);
}

// The oracle takes turns of more than 2 pi - 1e-7 for none, so its paths may miss the end by that.
TEST(DubinsAgainstOmpl, NeverLongerOnAGrid) {
  Random random(2);
  const Oracle oracle;
  for (int i = 0; i < 100'000; ++i) {
    const double radius_m = std::floor(random.uniform(1.0, 4.0));
    DubinsEnd from = grid_end(random, radius_m), to = grid_end(random, radius_m);
    if (i % 2 == 0) {
      const Pose2 T{{random.uniform(-20.0, 20.0), random.uniform(-20.0, 20.0)}, random.uniform(-kPi, kPi)};
      from = moved(T, from);
      to = moved(T, to);
    }
    const DubinsPath path = shortest_dubins_path(from, to);
    EXPECT_LE(path.length_m, oracle.length_m(from, to) + 1e-9) << i;
    EXPECT_GE(path.length_m, oracle.length_m(from, to) - 1e-6) << i;
    EXPECT_LT(greatest_gap(path, from, to), 1e-9) << i;
  }
}

}  // namespace
}  // namespace situation_awareness

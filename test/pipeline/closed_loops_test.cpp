// SPDX-License-Identifier: BSD-3-Clause
#include "situation_awareness/pipeline/closed_loops.hpp"

#include <gtest/gtest.h>

#include "situation_awareness/common/random.hpp"
#include "situation_awareness/common/time.hpp"

namespace situation_awareness {
namespace {

TEST(ClosedLoops, AllTimeIsOpenWithoutLoops) {
  const ClosedLoops loops;
  EXPECT_DOUBLE_EQ(loops.open_s(nanoseconds(2.0), nanoseconds(5.5)), 3.5);
  EXPECT_DOUBLE_EQ(loops.open_s(nanoseconds(5.5), nanoseconds(2.0)), 0.0);
}

// Against a list of seconds of which each is in a loop or not.
TEST(ClosedLoops, CountTimeThatIsInSeveralLoopsOnce) {
  Random random(3);
  constexpr int kSeconds = 100;
  for (int round = 0; round < 200; ++round) {
    ClosedLoops loops;
    bool closed[kSeconds] = {};
    for (int k = 0; k < 8; ++k) {
      const int from = static_cast<int>(random.uniform(0.0, kSeconds)),
                to = static_cast<int>(random.uniform(from, kSeconds));
      loops.add(nanoseconds(from), nanoseconds(to));
      for (int t = from; t < to; ++t) closed[t] = true;
    }
    const int from = static_cast<int>(random.uniform(0.0, kSeconds)),
              to = static_cast<int>(random.uniform(from, kSeconds));
    double open_s = 0.0;
    for (int t = from; t < to; ++t) open_s += closed[t] ? 0.0 : 1.0;
    EXPECT_NEAR(loops.open_s(nanoseconds(from), nanoseconds(to)), open_s, 1e-9);
  }
}

}  // namespace
}  // namespace situation_awareness

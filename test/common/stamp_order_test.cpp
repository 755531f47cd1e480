// SPDX-License-Identifier: BSD-3-Clause
#include "situation_awareness/common/stamp_order.hpp"

#include <gtest/gtest.h>

#include <limits>

namespace situation_awareness {
namespace {

using Verdict = StampOrder::Verdict;

TEST(StampOrder, DistinguishesALoopFromJitter) {
  StampOrder order(1.0);
  EXPECT_EQ(order.judge(nanoseconds(100.0)), Verdict::kNext);
  EXPECT_EQ(order.judge(nanoseconds(100.1)), Verdict::kNext);
  EXPECT_EQ(order.judge(nanoseconds(100.1)), Verdict::kRefused) << "repeats";
  EXPECT_EQ(order.judge(nanoseconds(99.5)), Verdict::kRefused) << "goes back a little";
  EXPECT_EQ(order.judge(nanoseconds(100.2)), Verdict::kNext) << "what was refused is forgotten";
  EXPECT_EQ(order.judge(nanoseconds(5.0)), Verdict::kRestart);
  EXPECT_EQ(order.judge(nanoseconds(5.1)), Verdict::kNext);
  EXPECT_EQ(order.judge(nanoseconds(1000.0)), Verdict::kNext) << "forward is forward";
}

// Stamps of a driver may have any value; the difference of two stamps need not fit into a stamp.
TEST(StampOrder, OrdersAnyTwoStamps) {
  constexpr std::int64_t kFirst = std::numeric_limits<std::int64_t>::min() + 1;
  constexpr std::int64_t kLast = std::numeric_limits<std::int64_t>::max();
  EXPECT_NEAR(seconds_between(kFirst, kLast), 0x1.0p64 * 1e-9, 1e-3);
  EXPECT_NEAR(seconds_between(kLast, kFirst), -0x1.0p64 * 1e-9, 1e-3);
  EXPECT_EQ(seconds_between(kLast - 1, kLast), 1e-9) << "small differences of large stamps are exact";
  StampOrder order(1.0);
  EXPECT_EQ(order.judge(kLast), Verdict::kNext);
  EXPECT_EQ(order.judge(kFirst), Verdict::kRestart);
  EXPECT_EQ(order.judge(kLast), Verdict::kNext);
}

}  // namespace
}  // namespace situation_awareness

// SPDX-License-Identifier: BSD-3-Clause
#include "situation_awareness/common/stamp_order.hpp"

#include <gtest/gtest.h>

namespace situation_awareness {
namespace {

using Verdict = StampOrder::Verdict;

TEST(StampOrder, TellsALoopFromJitter) {
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

}  // namespace
}  // namespace situation_awareness

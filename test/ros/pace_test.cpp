// SPDX-License-Identifier: BSD-3-Clause
#include "situation_awareness/ros/pace.hpp"

#include <algorithm>
#include <cstdint>

#include <gtest/gtest.h>

namespace situation_awareness::pace_test {
namespace {

constexpr std::int64_t kMillisecond_ns = 1'000'000;
constexpr std::int64_t kStart_ns = 1'700'000'000'000'000'000;

Pace pace_of(double duration_s) {
  Pace pace;
  for (int i = 0; i < 5; ++i) pace.handled(duration_s);
  return pace;
}

/// Number of dropped messages of `waiting` ones that are `period_ms` apart.
std::size_t passed_over(const Pace& pace, std::size_t waiting, std::int64_t period_ms) {
  const auto gaps = static_cast<std::int64_t>(waiting) - 1;
  return pace.passed_over(waiting, kStart_ns, kStart_ns + gaps * period_ms * kMillisecond_ns);
}

TEST(Pace, AtLeastOneIsHandled) {
  EXPECT_EQ(passed_over(pace_of(1.0), 1, 2), 0U);
  EXPECT_EQ(passed_over(pace_of(1.0), 0, 2), 0U);
}

TEST(Pace, NothingIsDroppedBeforeTheProcessingTimeIsKnown) { EXPECT_EQ(passed_over(Pace(), 20, 2), 0U); }

TEST(Pace, AllAreHandledWhereThereIsTimeBeforeTheNextIsDue) {
  EXPECT_EQ(passed_over(pace_of(0.004), 10, 50), 0U);  // 40 of 50 ms
  EXPECT_EQ(passed_over(pace_of(0.006), 10, 50), 9U);  // 60 of 50 ms
  EXPECT_EQ(passed_over(pace_of(0.0005), 3, 2), 0U);   // 500 Hz, but fast
  EXPECT_EQ(passed_over(pace_of(0.005), 3, 2), 2U);    // 500 Hz
}

struct Outcome {
  double worst_lag_s = 0.0;  ///< from the stamp of a message to its result, once the stall is over
  int passed_over = 0;
};

/// Ten seconds of a stage with a processing time of `duration_s` and messages every `period_s`, at their stamps.
/// After a second it stalls for `stall_s`.
Outcome simulate(double period_s, double duration_s, double stall_s) {
  Pace pace = pace_of(duration_s);
  Outcome outcome;
  const double stall_from_s = 1.0;
  const double over_s = stall_from_s + stall_s + period_s + 2.0 * duration_s;
  int next = 0;  // the oldest that waits
  for (double now_s = 0.0; now_s < 10.0;) {
    if (now_s >= stall_from_s && now_s < stall_from_s + stall_s) now_s = stall_from_s + stall_s;
    const int newest = static_cast<int>(now_s / period_s + 1e-9);
    if (newest < next) {
      now_s = next * period_s;
      continue;
    }
    const auto stamp_ns = [&](int i) { return kStart_ns + static_cast<std::int64_t>(i * period_s * 1e9); };
    const auto skipped = static_cast<int>(
        pace.passed_over(static_cast<std::size_t>(newest - next + 1), stamp_ns(next), stamp_ns(newest)));
    outcome.passed_over += skipped;
    next += skipped;
    now_s += duration_s;
    pace.handled(duration_s);
    if (now_s > over_s) outcome.worst_lag_s = std::max(outcome.worst_lag_s, now_s - next * period_s);
    ++next;
  }
  return outcome;
}

TEST(Pace, UnderOverloadTheLagIsThatOfOneMessageAndTheStageIsNeverIdle) {
  for (const double duration_s : {0.003, 0.0055, 0.013, 0.1}) {
    const Outcome outcome = simulate(0.002, duration_s, 0.0);
    EXPECT_LE(outcome.worst_lag_s, duration_s + 0.002 + 1e-9);
    EXPECT_NEAR(5000 - outcome.passed_over, 10.0 / duration_s, 0.01 * 10.0 / duration_s + 2.0) << "handled";
  }
}

TEST(Pace, AfterAStallNothingIsDroppedWhereThereIsTime) {
  for (const double stall_s : {0.0, 0.06, 0.2, 0.4}) {
    const Outcome outcome = simulate(0.05, 0.005, stall_s);
    EXPECT_EQ(outcome.passed_over, 0) << stall_s;
    EXPECT_LE(outcome.worst_lag_s, 0.005 + 1e-9) << stall_s;
  }
}

TEST(Pace, AfterAStallASlowStageIsUpToDateAtOnce) {
  for (const double stall_s : {0.2, 0.4, 3.0}) {
    const Outcome outcome = simulate(0.05, 0.045, stall_s);
    EXPECT_GT(outcome.passed_over, 0) << stall_s;
    EXPECT_LE(outcome.worst_lag_s, 0.05 + 0.045 + 1e-9) << stall_s;
  }
}

TEST(Pace, OneInterruptedMessageHasNoEffect) {
  Pace pace = pace_of(0.001);
  pace.handled(0.2);
  EXPECT_EQ(passed_over(pace, 4, 50), 0U);
  pace.handled(0.2);
  EXPECT_EQ(passed_over(pace, 4, 50), 0U);
  pace.handled(0.2);
  EXPECT_EQ(passed_over(pace, 4, 50), 3U) << "three of five are no accident";
}

TEST(Pace, OnlyTheNewestWhereStampsRepeatOrGoBack) {
  EXPECT_EQ(passed_over(pace_of(0.001), 3, 0), 2U);
  EXPECT_EQ(passed_over(pace_of(0.001), 3, -1000), 2U);
}

}  // namespace
}  // namespace situation_awareness::pace_test

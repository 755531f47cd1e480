// SPDX-License-Identifier: BSD-3-Clause
#include "situation_awareness/sim/schedule.hpp"

#include <cmath>
#include <cstddef>
#include <string>
#include <vector>

#include <gtest/gtest.h>

namespace situation_awareness::schedule_test {
namespace {

TEST(Schedule, RunsSensorsInTheOrderOfTheirTimes) {
  Schedule schedule;
  EXPECT_TRUE(std::isinf(schedule.next_time_s()));
  schedule.step();  // nothing is due
  std::string order;
  int fast = 0, slow = 0;
  schedule.add([&] { return fast / 10.0; }, [&] { order += 'f', ++fast; });
  schedule.add([&] { return slow / 4.0; }, [&] { order += 's', ++slow; });
  double time_s = 0.0;
  while (schedule.next_time_s() < 0.55) {
    EXPECT_GE(schedule.next_time_s(), time_s);
    time_s = schedule.next_time_s();
    schedule.step();
  }
  // 0 0.1 0.2 0.3 0.4 0.5 and 0 0.25 0.5; at one time in the order in which they were added.
  EXPECT_EQ(order, "fsffsfffs");
}

TEST(Schedule, RepeatsAtMultiplesOfAPeriod) {
  Schedule schedule;
  std::vector<double> times_s;
  schedule.add_every(0.1, [&](double time_s) { times_s.push_back(time_s); });
  while (schedule.next_time_s() < 100.05) schedule.step();
  ASSERT_EQ(times_s.size(), 1001U);
  for (int i = 0; i <= 1000; ++i) EXPECT_EQ(times_s[static_cast<std::size_t>(i)], i * 0.1);  // no sum of roundings
}

}  // namespace
}  // namespace situation_awareness::schedule_test

// SPDX-License-Identifier: BSD-3-Clause
#include "situation_awareness/common/rate_limit.hpp"

#include <vector>

#include <gtest/gtest.h>

#include "situation_awareness/common/random.hpp"

namespace situation_awareness::rate_limit_test {
namespace {

std::vector<double> passed(RateLimit limit, const std::vector<double>& times_s) {
  std::vector<double> result;
  for (const double time_s : times_s) {
    if (limit.passes(nanoseconds(time_s))) result.push_back(time_s);
  }
  return result;
}

std::vector<double> every(double period_s, double end_s) {
  std::vector<double> times_s;
  for (int i = 0; i * period_s < end_s; ++i) times_s.push_back(100.0 + i * period_s);
  return times_s;
}

TEST(RateLimit, PassesSlowerInputAndThinsFasterInput) {
  EXPECT_EQ(passed(RateLimit(5.0), every(1.0, 20.0)).size(), 20U);
  EXPECT_EQ(passed(RateLimit(5.0), every(0.05, 20.0)).size(), 100U);
  EXPECT_NEAR(static_cast<double>(passed(RateLimit(6.0), every(0.05, 20.0)).size()), 120.0, 1.0)
      << "a rate that does not divide the other";
}

TEST(RateLimit, NeverPassesMoreThanItsRate) {
  Random random(3);
  std::vector<double> times_s{0.0};
  for (int i = 0; i < 2000; ++i) {
    const bool pause = random.uniform(0.0, 1.0) < 0.01;
    times_s.push_back(times_s.back() + random.uniform(0.0, pause ? 5.0 : 0.1));
  }
  constexpr double kRate_hz = 7.0;
  const std::vector<double> seen_s = passed(RateLimit(kRate_hz), times_s);
  for (std::size_t first = 0; first < seen_s.size(); ++first) {
    for (std::size_t last = first; last < seen_s.size(); ++last) {
      ASSERT_LE(static_cast<double>(last - first + 1), 2.0 + (seen_s[last] - seen_s[first]) * kRate_hz);
    }
  }
}

}  // namespace
}  // namespace situation_awareness::rate_limit_test

// SPDX-License-Identifier: BSD-3-Clause
#include "situation_awareness/estimation/nis_monitor.hpp"

#include <gtest/gtest.h>

#include <cmath>

#include "situation_awareness/common/random.hpp"

namespace situation_awareness::nis_monitor_test {
namespace {

constexpr int kDegrees = 5;

/// Innovations that are `scale` times as large as expected by their filter.
void add(NisMonitor& monitor, int matches, double scale, Random& random) {
  for (int i = 0; i < matches; ++i) {
    double mahalanobis2 = 0.0;
    for (int k = 0; k < kDegrees; ++k) mahalanobis2 += std::pow(scale * random.normal(), 2);
    monitor.add(1, mahalanobis2);
  }
}

TEST(NisMonitor, TheMeanOfAConsistentFilterLiesWithinItsBoundsInNineteenOfTwentySummaries) {
  Random random(3);
  NisMonitor monitor(kDegrees);
  const int summaries = 4000;
  int inside = 0;
  for (int i = 0; i < summaries; ++i) {
    add(monitor, 1 + i % 40, 1.0, random);
    const NisMonitor::Summary summary = monitor.summarise();
    EXPECT_EQ(summary.matches, 1U + static_cast<unsigned>(i) % 40U);
    EXPECT_LT(summary.low, 1.0);
    EXPECT_GT(summary.high, 1.0);
    inside += summary.mean >= summary.low && summary.mean <= summary.high ? 1 : 0;
    EXPECT_FALSE(summary.too_certain);
  }
  const double sigma = std::sqrt(0.95 * 0.05 / summaries);
  EXPECT_NEAR(static_cast<double>(inside) / summaries, 0.95, 4.0 * sigma);
}

TEST(NisMonitor, OnlyAPersistentDeviationIsInconsistent) {
  Random random(4);
  NisMonitor monitor(kDegrees);
  for (int i = 1; i <= 3 * NisMonitor::kPersistent; ++i) {
    add(monitor, 40, 2.0, random);
    EXPECT_EQ(monitor.summarise().too_certain, i >= NisMonitor::kPersistent) << i;
    if (i % 5 == 0) {
      EXPECT_EQ(monitor.summarise().matches, 0U);  // a pause has no effect
    }
  }
  add(monitor, 40, 1.0, random);
  EXPECT_FALSE(monitor.summarise().too_certain);
}

}  // namespace
}  // namespace situation_awareness::nis_monitor_test

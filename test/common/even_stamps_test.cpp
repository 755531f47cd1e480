// SPDX-License-Identifier: BSD-3-Clause
// Stamps that come in bunches, and such that do not.
#include "situation_awareness/common/even_stamps.hpp"

#include <cmath>
#include <functional>
#include <random>

#include <gtest/gtest.h>

#include "situation_awareness/common/time.hpp"

namespace situation_awareness::even_stamps_test {
namespace {

constexpr double kPeriod_s = 0.01;

struct Stream {
  std::function<double(int k)> stamp_s, received_s = [](int) { return std::nan(""); };
  int count = 2000;
};

/// Largest error of the stamps from `from` on, of measurement k at k periods, with their mean taken off.
struct Errors {
  double largest_s = 0.0, mean_s = 0.0;
  bool is_spread = false;
};

Errors errors_of(const Stream& stream, int from = 1000) {
  EvenStamps even;
  std::vector<double> errors_s;
  std::int64_t before_ns = StampOrder::kNone;
  for (int k = 0; k < stream.count; ++k) {
    const double received_s = stream.received_s(k);
    const std::int64_t stamp_ns =
        even.add(nanoseconds(100.0 + stream.stamp_s(k)),
                 std::isnan(received_s) ? StampOrder::kNone : nanoseconds(100.0 + received_s));
    if (k >= from) {
      EXPECT_GT(stamp_ns, before_ns) << k;
      errors_s.push_back(seconds_between(0, stamp_ns) - 100.0 - kPeriod_s * k);
    }
    before_ns = stamp_ns;
  }
  Errors errors;
  errors.is_spread = even.is_spread();
  for (const double error_s : errors_s) errors.mean_s += error_s / static_cast<double>(errors_s.size());
  for (const double error_s : errors_s)
    errors.largest_s = std::max(errors.largest_s, std::abs(error_s - errors.mean_s));
  return errors;
}

/// Stamped when the last of so many was read.
double read_at(int k, int at_once) { return kPeriod_s * (k / at_once * at_once + at_once - 1) + 0.001; }

TEST(EvenStamps, SpreadsWhatIsReadAtOnce) {
  for (const int at_once : {2, 4, 10, 20, 50, 100}) {
    for (const double apart_s : {0.0, 0.0001, 0.001}) {
      Stream stream{[&](int k) {
        return read_at(k, at_once) - apart_s * (at_once - 1 - k % at_once) - (apart_s > 0.0 ? 0.0 : 3e-9 * (k % 2));
      }};
      stream.received_s = [&](int k) { return read_at(k, at_once) + 0.0005; };
      const Errors errors = errors_of(stream);
      EXPECT_TRUE(errors.is_spread) << at_once;
      EXPECT_LT(errors.largest_s, 1e-4) << at_once << " " << apart_s;
      EXPECT_NEAR(errors.mean_s, 0.001, 1e-4) << at_once << " " << apart_s;
    }
  }
}

TEST(EvenStamps, FollowsBunchesOfAnySizeThatAreReadABitLate) {
  std::mt19937 random(1);
  std::vector<double> stamps_s;
  for (int k = 0; k < 2000;) {
    const int at_once = 3 + static_cast<int>(random() % 12);
    const double late_s = 0.002 * std::uniform_real_distribution<double>()(random);
    for (int i = 0; i < at_once; ++i) stamps_s.push_back(kPeriod_s * (k + at_once - 1) + late_s);
    k += at_once;
  }
  const Errors errors = errors_of({[&](int k) { return stamps_s[static_cast<std::size_t>(k)]; }});
  EXPECT_TRUE(errors.is_spread);
  EXPECT_LT(errors.largest_s, 0.002);
  EXPECT_NEAR(errors.mean_s, 0.001, 0.001);
}

TEST(EvenStamps, AClockOfCoarseStepsIsNotBehind) {
  for (const double step_s : {0.05, 0.1, 1.0}) {
    Stream stream{[&](int k) { return step_s * std::floor(kPeriod_s * k / step_s + 1e-9); }};
    stream.received_s = [](int k) { return kPeriod_s * k + 0.001; };
    const Errors errors = errors_of(stream);
    EXPECT_TRUE(errors.is_spread) << step_s;
    EXPECT_LT(errors.largest_s, 1e-4) << step_s;
    EXPECT_NEAR(errors.mean_s, 0.0, 0.001) << step_s;
  }
}

TEST(EvenStamps, LeavesOthersAsTheyAre) {
  std::mt19937 random(2);
  std::normal_distribution<double> noise;
  const std::vector<std::function<double(int)>> streams = {
      [](int k) { return kPeriod_s * k; },
      [&](int k) { return kPeriod_s * k + 0.002 * noise(random); },
      [&](int k) { return kPeriod_s * k + 0.02 * noise(random); },
      [](int k) { return kPeriod_s * (k + k / 50 * 30); },                       // it is silent for a while, often
      [](int k) { return kPeriod_s * (k - (k % 50 == 7 ? 1 : 0)); },             // some repeat the one before
      [](int k) { return k % 2 == 0 ? kPeriod_s * k : kPeriod_s * k - 0.004; },  // short and long in turn
  };
  for (std::size_t i = 0; i < streams.size(); ++i) {
    EvenStamps even;
    for (int k = 0; k < 2000; ++k) {
      const std::int64_t stamp_ns = nanoseconds(100.0 + streams[i](k));
      ASSERT_EQ(even.add(stamp_ns), stamp_ns) << i << " " << k;
    }
    EXPECT_FALSE(even.is_bunched()) << i;
  }
}

TEST(EvenStamps, TellsWhereMeasurementsAreMissing) {
  std::mt19937 random(3);
  EvenStamps even;
  int k = 0;
  for (int bunch = 0; bunch < 200; ++bunch) {
    const int lost = static_cast<int>(random() % 150);
    k += lost + 10;
    for (int i = 0; i < 10; ++i) even.add(nanoseconds(100.0 + kPeriod_s * k));
  }
  EXPECT_TRUE(even.is_bunched());
  EXPECT_FALSE(even.is_spread());
}

TEST(EvenStamps, ForgetsBunchesThatAreOver) {
  EvenStamps even;
  for (int k = 0; k < 1000; ++k) even.add(nanoseconds(100.0 + read_at(k, 10)));
  EXPECT_TRUE(even.is_spread());
  for (int k = 1000; k < 2000; ++k) even.add(nanoseconds(100.0 + kPeriod_s * k));
  EXPECT_FALSE(even.is_spread());
  EXPECT_EQ(even.add(nanoseconds(120.0)), nanoseconds(120.0));
  for (int k = 0; k < 1000; ++k) even.add(nanoseconds(50.0 + read_at(k, 10)));  // time began anew
  EXPECT_TRUE(even.is_spread());
}

}  // namespace
}  // namespace situation_awareness::even_stamps_test

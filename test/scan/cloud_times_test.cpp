// SPDX-License-Identifier: BSD-3-Clause
#include "situation_awareness/scan/cloud_times.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <cstddef>
#include <cstdint>
#include <functional>
#include <limits>
#include <optional>
#include <string>
#include <vector>

#include "situation_awareness/common/random.hpp"

namespace situation_awareness::cloud_times_test {
namespace {

constexpr double kNan = std::numeric_limits<double>::quiet_NaN();
constexpr std::int64_t kStamp_ns = 1'700'000'000'250'000'000;
constexpr std::size_t kPoints = 2000;

/// Numbers of a sweep by the time of the point after the stamp and by the stamp, in s.
using Number = std::function<double(double time_s, double stamp_s)>;

struct Sensor {
  double period_s = 0.1;
  double sweep_s = 0.1;
  bool are_whole = false;
  bool stamp_is_last = false;

  double time_s(std::size_t point) const {
    return sweep_s * static_cast<double>(point) / kPoints - (stamp_is_last ? sweep_s : 0.0);
  }
};

bool always(std::size_t /*point*/) { return true; }

/// Of the fourth cloud; `spoil` changes its numbers.
std::optional<CloudTimeScale> read(const Sensor& sensor, const Number& number,
                                   const std::function<void(std::vector<double>&)>& spoil = {},
                                   const std::function<bool(std::size_t)>& has_return = always) {
  CloudTimeReader reader;
  std::optional<CloudTimeScale> scale;
  for (int cloud = 0; cloud < 4; ++cloud) {
    const auto stamp_ns = kStamp_ns + static_cast<std::int64_t>(1e9 * sensor.period_s * cloud);
    std::vector<double> numbers;
    for (std::size_t i = 0; i < kPoints; ++i) {
      const double value = number(sensor.time_s(i), 1e-9 * static_cast<double>(stamp_ns));
      numbers.push_back(sensor.are_whole ? std::floor(value) : value);
    }
    if (spoil) spoil(numbers);
    scale = reader.read(numbers, has_return, sensor.are_whole, stamp_ns);
    if (cloud < 3 || !scale) continue;
    for (std::size_t i = 0; i < kPoints; ++i) {
      if (std::isnan(numbers[i]) || numbers[i] < scale->first || numbers[i] > scale->last) continue;
      EXPECT_NEAR(scale->time_s(numbers[i]), sensor.time_s(i), 2e-3 * sensor.sweep_s) << i;
    }
  }
  return scale;
}

struct Unit {
  const char* name;
  double per_s;
  bool are_whole;
};
constexpr Unit kUnits[] = {{"s", 1.0, false},  {"ms", 1e3, false},      {"us", 1e6, false},
                           {"ns", 1e9, false}, {"whole us", 1e6, true}, {"whole ns", 1e9, true}};

TEST(CloudTimeReader, FindsTheUnitThatFitsThePeriod) {
  for (const Unit& unit : kUnits) {
    for (const double period_s : {0.05, 0.1, 0.2}) {
      for (const bool stamp_is_last : {false, true}) {
        SCOPED_TRACE(std::string(unit.name) + " " + std::to_string(period_s));
        const Sensor sensor{period_s, period_s, unit.are_whole, stamp_is_last};
        EXPECT_TRUE(read(sensor, [&](double t, double /*stamp_s*/) { return unit.per_s * t; }));
        // A sector is swept in a part of the period.
        const Sensor sector{period_s, 0.3 * period_s, unit.are_whole, stamp_is_last};
        EXPECT_TRUE(read(sector, [&](double t, double /*stamp_s*/) { return unit.per_s * t; }));
      }
    }
  }
}

TEST(CloudTimeReader, FindsTheTimeFromWhichTheyCount) {
  for (const Unit& unit : kUnits) {
    SCOPED_TRACE(unit.name);
    const Sensor sensor{0.1, 0.1, unit.are_whole};
    EXPECT_TRUE(read(sensor, [&](double t, double stamp_s) { return unit.per_s * (stamp_s + t); }));
    EXPECT_TRUE(read(sensor, [&](double t, double stamp_s) { return unit.per_s * (stamp_s - 1.7e9 + 777.0 + t); }));
    const auto one = CloudTimeReader().read({unit.per_s * (1e-9 * static_cast<double>(kStamp_ns) + 0.0625)}, always,
                                            false, kStamp_ns);
    ASSERT_TRUE(one);  // a point alone
    EXPECT_NEAR(one->times().first_s, 0.0625, 1e-6);
    const Sensor late{0.1, 0.1, unit.are_whole, true};
    EXPECT_TRUE(read(late, [&](double t, double stamp_s) { return unit.per_s * (stamp_s + t); }));
  }
}

TEST(CloudTimeReader, TakesNumbersUpToOneForPartsOfThePeriod) {
  for (const double period_s : {0.05, 0.1, 0.25}) {
    const Sensor sensor{period_s, period_s};
    EXPECT_TRUE(read(sensor, [&](double t, double /*stamp_s*/) { return t / period_s; })) << period_s;
  }
  const Sensor slow{1.0, 1.0};  // seconds, not parts of them
  EXPECT_TRUE(read(slow, [](double t, double /*stamp_s*/) { return t; }));
}

TEST(CloudTimeReader, LeavesOutPointsWithoutAReturn) {
  const auto has_return = [](std::size_t i) { return i % 3 != 0; };
  for (const double none : {kNan, 0.0, -1.0, 1e30}) {
    const auto scale = read(
        {}, [](double t, double stamp_s) { return stamp_s + t; },
        [&](std::vector<double>& numbers) {
          for (std::size_t i = 0; i < kPoints; i += 3) numbers[i] = none;
        },
        has_return);
    ASSERT_TRUE(scale) << none;
    EXPECT_EQ(scale->bad_points, 0U);
    EXPECT_TRUE(std::isnan(scale->time_s(none)));
  }
}

TEST(CloudTimeReader, AFewBadNumbersCostTheirPointsAlone) {
  for (const double bad : {kNan, std::numeric_limits<double>::infinity(), -0.7, 3.6, 0.9, 1e18}) {
    const auto scale = read(
        {}, [](double t, double /*stamp_s*/) { return t; },
        [&](std::vector<double>& numbers) {
          for (const std::size_t i : {10, 700, 1500}) numbers[i] = bad;
        });
    ASSERT_TRUE(scale) << bad;
    EXPECT_EQ(scale->bad_points, 3U) << bad;
  }
  EXPECT_TRUE(read(
      {0.1, 0.1, true}, [](double t, double /*stamp_s*/) { return 1e9 * t; },
      [](std::vector<double>& numbers) { numbers[100] = numbers[500] = 3.6e9; }));
}

TEST(CloudTimeReader, RefusesWhatIsNoTime) {
  Random random(3);
  EXPECT_FALSE(read({}, [&](double /*t*/, double /*stamp_s*/) { return random.uniform(-1e6, 1e6); }));
  EXPECT_FALSE(read({}, [](double /*t*/, double /*stamp_s*/) { return kNan; }));
  EXPECT_FALSE(read({}, [](double /*t*/, double /*stamp_s*/) { return 1000.0; }));
  EXPECT_FALSE(read(
      {}, [](double t, double /*stamp_s*/) { return t; },
      [](std::vector<double>& numbers) {
        for (std::size_t i = 0; i < kPoints / 4; ++i) numbers[i] = kNan;
      }));
  EXPECT_FALSE(CloudTimeReader().read({}, always, false, kStamp_ns));
}

// Few returns, in a moment: the unit stays what it was.
TEST(CloudTimeReader, KeepsTheUnitWhereACloudDoesNotTell) {
  CloudTimeReader reader;
  std::vector<double> numbers;
  for (std::size_t i = 0; i < kPoints; ++i) numbers.push_back(std::floor(1e5 * static_cast<double>(i) / kPoints));
  ASSERT_TRUE(reader.read(numbers, always, true, kStamp_ns));
  ASSERT_TRUE(reader.read(numbers, always, true, kStamp_ns + 100'000'000));
  numbers = {50'000.0, 50'100.0};
  const auto scale = reader.read(numbers, always, true, kStamp_ns + 200'000'000);
  ASSERT_TRUE(scale);
  EXPECT_NEAR(scale->times().first_s, 0.05, 1e-9);
  // The first cloud, of one moment: whole numbers are ns.
  const auto first = CloudTimeReader().read({50'000.0, 50'000.0}, always, true, kStamp_ns);
  ASSERT_TRUE(first);
  EXPECT_NEAR(first->times().first_s, 5e-5, 1e-9);
}

}  // namespace
}  // namespace situation_awareness::cloud_times_test

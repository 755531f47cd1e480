// SPDX-License-Identifier: BSD-3-Clause
// Stamps and altitudes of fixes, and the pose by fixes whose altitudes jump.
#include "situation_awareness/pose/fix_consistency.hpp"

#include <cmath>
#include <functional>
#include <random>
#include <string>

#include <gtest/gtest.h>

#include "gps_ins_flight.hpp"
#include "situation_awareness/common/time.hpp"
#include "situation_awareness/pose/gps_ins.hpp"
#include "situation_awareness/pose/local_world.hpp"

namespace situation_awareness::fix_consistency_test {
namespace {

constexpr double kMostLate_s = 1.0;

/// Fixes at 5 Hz with so much between their stamps and those of the IMU, received so late on average.
struct Receiver {
  double ahead_s = 0.0, late_s = 0.06, jitter_s = 0.01, imu_late_s = 0.001;
  double clock_s = 0.0;     ///< of the receipts against that of the stamps
  double imu_step_s = 0.0;  ///< of the clock that stamps the samples; 0: a fine one
  double imu_rate_hz = 100.0;
};

/// `each`: called after each fix.
FixConsistency after(
    const Receiver& receiver, double seconds, unsigned seed = 1,
    const std::function<void(const FixConsistency&)>& each = [](const FixConsistency&) {}) {
  FixConsistency consistency;
  std::mt19937 random(seed);
  std::exponential_distribution<double> more;
  const double step_s = receiver.imu_step_s;
  const auto samples_per_fix = static_cast<int>(receiver.imu_rate_hz / 5.0);
  for (int i = 0; i / receiver.imu_rate_hz < seconds; ++i) {
    const double t = 1000.37 + i / receiver.imu_rate_hz;
    const double stamp_s = step_s > 0.0 ? step_s * std::floor(t / step_s) : t;
    consistency.add_imu(nanoseconds(stamp_s),
                        nanoseconds(t + receiver.imu_late_s + 0.002 * more(random) + receiver.clock_s));
    if (i % samples_per_fix != samples_per_fix / 2) continue;
    const double received_s = t + receiver.late_s + receiver.jitter_s * more(random) + receiver.clock_s;
    consistency.add_fix(nanoseconds(t + receiver.ahead_s), nanoseconds(received_s));
    each(consistency);
  }
  return consistency;
}

TEST(FixConsistency, NamesStampsThatContradictTheirReceipts) {
  for (const double clock_s : {0.0, -900.0}) {  // that of the receipts may be any
    for (const double ahead_s : {18.0, -18.0, 0.5, -2.0, 3600.0, -1000.0}) {
      for (unsigned seed = 1; seed <= 5; ++seed) {
        Receiver receiver;
        receiver.ahead_s = ahead_s;
        receiver.clock_s = clock_s;
        const FixConsistency consistency = after(receiver, 2.0, seed);
        ASSERT_TRUE(consistency.lead());
        EXPECT_NEAR(consistency.lead()->lead_s, ahead_s, 0.1);
        const std::string text = consistency.contradiction(kMostLate_s);
        EXPECT_NE(text.find(ahead_s > 0.0 ? "ahead of" : "behind"), std::string::npos) << text;
        EXPECT_EQ(text.find("GPS time") != std::string::npos, std::abs(ahead_s) == 18.0) << text;
      }
    }
  }
}

TEST(FixConsistency, SaysNothingOfDelays) {
  for (const Receiver& receiver :
       {Receiver{}, Receiver{0.0, 0.9, 0.02}, Receiver{0.0, 0.2, 0.3}, Receiver{0.0, 0.06, 0.01, 0.15},
        Receiver{0.0, 0.0, 0.0, 0.025}, Receiver{0.0, 0.06, 0.01, 0.001, 1e9}}) {
    for (unsigned seed = 1; seed <= 20; ++seed) {
      EXPECT_EQ(after(receiver, 10.0, seed).contradiction(kMostLate_s), "");
    }
  }
  FixConsistency unknown;
  for (int i = 0; i < 100; ++i) {
    unknown.add_imu(nanoseconds(i), StampOrder::kNone);
    unknown.add_fix(nanoseconds(i + 18.0), StampOrder::kNone);
  }
  EXPECT_EQ(unknown.contradiction(kMostLate_s), "");
}

TEST(FixConsistency, SaysNothingOfACoarseClock) {
  for (const double rate_hz : {50.0, 100.0, 400.0}) {
    for (const double step_s : {0.1, 0.5, 1.0}) {
      for (unsigned seed = 1; seed <= 5; ++seed) {
        Receiver receiver;
        receiver.imu_step_s = step_s;
        receiver.imu_rate_hz = rate_hz;
        after(receiver, 10.0, seed, [&](const FixConsistency& consistency) {
          EXPECT_EQ(consistency.contradiction(kMostLate_s), "") << step_s << " s at " << rate_hz << " Hz";
        });
        receiver.ahead_s = 18.0;
        EXPECT_NE(after(receiver, 2.0, seed).contradiction(kMostLate_s).find("GPS time"), std::string::npos);
      }
    }
  }
}

std::string after_altitudes(const std::function<double(double t)>& altitude_m, double sigma_m = 0.6) {
  FixConsistency consistency;
  std::mt19937 random(7);
  std::normal_distribution<double> noise;
  for (int i = 0; i < 300; ++i) {
    const double t = 0.2 * i;
    consistency.add_altitude(nanoseconds(t), altitude_m(t) + sigma_m * noise(random), sigma_m);
  }
  return consistency.contradiction(kMostLate_s);
}

TEST(FixConsistency, NamesAltitudesThatJump) {
  EXPECT_NE(after_altitudes([](double t) { return t > 30.0 ? 507.0 : 460.0; }).find("jumps by 4"), std::string::npos);
  EXPECT_NE(after_altitudes([](double t) { return t > 30.0 ? 413.0 : 460.0; }).find("jumps by -4"), std::string::npos);
  EXPECT_NE(after_altitudes([](double t) { return std::fmod(t, 20.0) < 10.0 ? 0.0 : 20.0; }), "");
  EXPECT_EQ(after_altitudes([](double t) { return t == 30.0 ? 0.0 : 460.0; }), "");  // an outlier
  EXPECT_EQ(after_altitudes([](double t) { return 9.0 * t; }), "");
  EXPECT_EQ(after_altitudes([](double t) { return t > 30.0 ? 470.0 : 460.0; }, 5.0), "");
}

struct Flown {
  double error_m = 0.0;  ///< root mean square of x and y, from 40 s on
  std::uint64_t refused = 0, level = 0;
  bool is_ready = false;
};

Flown fly(const std::function<double(double t)>& offset_m, std::uint64_t seed) {
  FlightRun run({}, {}, seed);
  GpsIns ins({}, {});
  double sum_m2 = 0.0;
  int count = 0;
  for (; run.time_s() < 80.0; run.next()) {
    ins.add_imu(run.sample());
    if (!run.has_fix()) continue;
    const Eigen::Vector3d fix = run.fix() + offset_m(run.time_s()) * Eigen::Vector3d::UnitZ();
    ins.add_position(run.stamp_ns(), fix, run.fix_covariance());
    if (run.time_s() < 40.0) continue;
    sum_m2 += (ins.pose().T_world_base.translation() - run.T_world_base().translation()).head<2>().squaredNorm();
    ++count;
  }
  return {std::sqrt(sum_m2 / count), ins.counters().of("fix outside its gate"),
          ins.counters().of("fix outside its gate in height: used in x and y"), ins.is_ready()};
}

TEST(GpsInsHeights, AFixOfAnotherHeightIsUsedInXAndY) {
  const std::vector<std::function<double(double)>> offsets_m = {
      [](double t) { return t > 45.0 ? -47.0 : 0.0; }, [](double t) { return t > 45.0 ? 47.0 : 0.0; },
      [](double t) { return std::fmod(t, 20.0) > 10.0 ? 30.0 : 0.0; },
      [](double t) { return t > 50.0 && t < 52.0 ? 460.0 : 0.0; }};
  for (std::uint64_t seed = 1; seed <= 3; ++seed) {
    const Flown good = fly([](double) { return 0.0; }, seed);
    EXPECT_EQ(good.level, 0u);
    for (std::size_t i = 0; i < offsets_m.size(); ++i) {
      const Flown flown = fly(offsets_m[i], seed);
      EXPECT_TRUE(flown.is_ready);
      EXPECT_LT(flown.error_m, 1.2 * good.error_m + 0.05) << i << " " << seed;
      EXPECT_EQ(flown.refused, 0u) << i;
      EXPECT_GE(flown.level, 5u) << i;
      EXPECT_LE(flown.level, 60u) << i;  // a height that stays is believed
    }
  }
}

/// As fly, by fixes of which some have no altitude.
double error_without_altitudes(const std::function<bool(double t)>& is_level, std::uint64_t seed) {
  const GeodeticPosition origin{47.0, 8.0, 400.0};
  FlightRun run({}, {}, seed);
  GpsIns ins({}, {}, origin);
  double sum_m2 = 0.0;
  int count = 0;
  for (; run.time_s() < 80.0; run.next()) {
    ins.add_imu(run.sample());
    if (!run.has_fix()) continue;
    GeodeticFix fix{run.stamp_ns(), true, geodetic_position(origin, run.fix()), run.fix_covariance()};
    if (is_level(run.time_s())) {
      fix.has_altitude = false;
      fix.position.altitude_m = 400.0;
      fix.covariance_m2(2, 2) = 2500.0;
    }
    ins.add_fix(fix);
    if (run.time_s() < 40.0) continue;
    sum_m2 += (ins.pose().T_world_base.translation() - run.T_world_base().translation()).head<2>().squaredNorm();
    ++count;
  }
  return std::sqrt(sum_m2 / count);
}

TEST(GpsInsHeights, AFixWithoutAnAltitudeIsUsedInXAndY) {
  for (std::uint64_t seed = 1; seed <= 3; ++seed) {
    const double good_m = error_without_altitudes([](double) { return false; }, seed);
    EXPECT_LT(error_without_altitudes([](double) { return true; }, seed), 1.2 * good_m);
    EXPECT_LT(error_without_altitudes([](double t) { return t > 20.0 && t < 50.0; }, seed), 1.2 * good_m);
    EXPECT_LT(error_without_altitudes([](double t) { return std::fmod(t, 0.4) < 0.2; }, seed), 1.2 * good_m);
  }
}

}  // namespace
}  // namespace situation_awareness::fix_consistency_test

// SPDX-License-Identifier: BSD-3-Clause
// The pose by GPS and INS under what sensors and their drivers do wrong, and where nothing shows what is asked for.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <string>
#include <utility>
#include <vector>

#include "gps_ins_drive.hpp"
#include "situation_awareness/estimation/gating.hpp"
#include "situation_awareness/geometry/angles.hpp"
#include "situation_awareness/pose/gps_ins.hpp"
#include "support/covariance.hpp"
#include "support/odd_number.hpp"

namespace situation_awareness::gps_ins_faults_test {
namespace {

double yaw_error(const Eigen::Isometry3d& truth, const GpsInsPose& pose) {
  return wrap_to_pi(base_yaw(truth) - base_yaw(pose.T_world_base));
}

/// Of the mean of `count` squared standard normal numbers.
std::pair<double, double> band_95(double count) {
  return {chi_square_quantile(0.025, count) / count, chi_square_quantile(0.975, count) / count};
}

// --- covariances ---

// The direction (1, -1) has the variance -0.75 m^2.
TEST(GpsInsFaults, AFixWhoseCovarianceIsNoneIsRefused) {
  const std::vector<Eigen::Matrix3d> none = [] {
    Eigen::Matrix3d a, b, c;
    a << 2.25, 3.0, 0.0, 3.0, 2.25, 0.0, 0.0, 0.0, 5.0;
    b << 2.25, 0.0, 0.0, 0.0, 2.25, 4.0, 0.0, 4.0, 5.0;
    c << 2.25, 1.0, 0.0, -1.0, 2.25, 0.0, 0.0, 0.0, 5.0;
    return std::vector<Eigen::Matrix3d>{a, b, c};
  }();
  FlightRun run({}, {}, 1);
  GpsIns ins({}, {});
  std::size_t given = 0;
  for (; run.time_s() < 80.0; run.next()) {
    ins.add_imu(run.sample());
    if (!run.has_fix()) continue;
    const Eigen::Vector3d fix = run.fix();
    if (run.time_s() > 40.0 && given < none.size()) ins.add_position(run.stamp_ns(), fix, none[given++]);
    ins.add_position(run.stamp_ns(), fix, run.fix_covariance());
    const GpsInsPose pose = ins.pose();
    if (run.time_s() < 40.0 || !pose.is_ready) continue;
    EXPECT_TRUE(is_covariance(pose.covariance));
    EXPECT_LT((pose.T_world_base.translation() - run.T_world_base().translation()).norm(), 8.0);
  }
  EXPECT_TRUE(ins.is_ready());
  EXPECT_EQ(ins.counters().of("fix covariance not positive semidefinite"), none.size());
  EXPECT_EQ(ins.counters().of("fix outside its gate"), 0u);
}

// --- sideslip ---

// A vehicle goes where its base heads, not where its IMU does, which is far ahead of the axle.
TEST(GpsInsFaults, SideslipIsThatOfTheBaseNotOfTheImu) {
  for (const double lever_m : {0.0, 1.5, -1.5}) {
    double square = 0.0, nees = 0.0;
    int count = 0;
    for (std::uint64_t seed = 0; seed < 6; ++seed) {
      GpsInsMounting mounting;
      mounting.T_base_imu.translate(Eigen::Vector3d(lever_m, 0.0, 0.3));
      mounting.antenna_base_m = {0.2, 0.0, 1.0};
      SimulatedDrive drive;
      drive.initial_yaw_rad = 0.77 * static_cast<double>(seed);
      drive.lever_m = mounting.T_base_imu.translation();
      drive.legs = {{5.0, 0.0, 0.0}};
      for (int i = 0; i < 5; ++i) {
        drive.legs.insert(drive.legs.end(), {{8.0, 2.0, 0.0}, {10.0, 2.0, 0.4}, {5.0, 3.0, 0.0}, {10.0, 3.0, -0.3}});
      }
      FlightSensors sensors;
      sensors.imu_rate_hz = 50.0;
      sensors.correlated_share = 0.0;
      GpsInsParams params;
      params.sideslip_sigma_m_s = 0.1;
      DriveRun run(drive, sensors, seed, mounting);
      GpsIns ins(params, mounting);
      for (; run.time_s() < 160.0; run.next()) {
        ins.add_imu(run.sample());
        if (!run.has_fix()) continue;
        ins.add_position(run.stamp_ns(), run.fix(), run.fix_covariance());
        const GpsInsPose pose = ins.pose();
        if (!pose.is_ready || run.time_s() < 60.0) continue;
        const double error = yaw_error(run.T_world_base(), pose);
        square += error * error;
        nees += error * error / yaw_variance(pose);
        ++count;
      }
    }
    EXPECT_GT(count, 2500) << lever_m;
    EXPECT_LT(std::sqrt(square / count), 0.02) << lever_m;
    // Of one error; some ten independent ones in each run.
    EXPECT_LT(nees / count, band_95(60.0).second) << lever_m;
  }
}

// --- rates and delays ---

TEST(GpsInsFaults, AnyUsualRateAndDelayWorks) {
  for (const double rate_hz : {25.0, 50.0, 100.0, 400.0, 800.0, 1000.0, 2000.0, 4000.0}) {
    for (const double delay_s : {0.0, 0.5, 0.95}) {
      if (rate_hz > 1000.0 && delay_s == 0.5) continue;
      FlightSensors sensors;
      sensors.imu_rate_hz = rate_hz;
      FlightRun run({}, sensors, 3);
      GpsIns ins({}, {});
      std::vector<std::pair<std::int64_t, Eigen::Vector3d>> fixes;
      std::size_t next = 0;
      for (; run.time_s() < 40.0; run.next()) {
        ins.add_imu(run.sample());
        if (run.has_fix()) fixes.emplace_back(run.stamp_ns(), run.fix());
        while (next < fixes.size() && fixes[next].first + nanoseconds(delay_s) <= run.stamp_ns()) {
          ins.add_position(fixes[next].first, fixes[next].second, run.fix_covariance());
          ++next;
        }
      }
      const GpsInsPose pose = ins.pose();
      ASSERT_TRUE(pose.is_ready) << rate_hz << " Hz, " << delay_s << " s: " << pose.reason;
      const Eigen::Vector3d error_m = run.T_world_base().translation() - pose.T_world_base.translation();
      EXPECT_LT(mahalanobis2(error_m, pose.covariance.topLeftCorner<3, 3>()), chi_square_quantile(0.9999, 3))
          << rate_hz;
      EXPECT_LT(std::abs(yaw_error(run.T_world_base(), pose)), 0.15) << rate_hz;
      // Those from before the filters began.
      EXPECT_LE(ins.counters().of("fix too late"), 10u) << rate_hz;
    }
  }
}

TEST(GpsInsFaults, AnImuThatIsTooFastIsNamed) {
  FlightSensors sensors;
  sensors.imu_rate_hz = 10000.0;
  FlightRun run({}, sensors, 3);
  GpsIns ins({}, {});
  for (; run.time_s() < 4.0; run.next()) {
    ins.add_imu(run.sample());
    if (run.has_fix()) ins.add_position(run.stamp_ns() - 900'000'000, run.fix(), run.fix_covariance());
  }
  EXPECT_FALSE(ins.is_ready());
  EXPECT_NE(std::string(ins.reason()).find("4,000 Hz"), std::string::npos) << ins.reason();
}

// What is asked of the history is there, also while it grows.
TEST(InertialHistory, GrowsWithTheRateAndKeepsItsOrder) {
  InertialHistory history(2.0, 5000.0, 0.0003);
  for (int i = 0; i < 30000; ++i) {
    history.add({i * 250'000LL, Eigen::Vector3d(i, 0.0, 0.0), Eigen::Vector3d::Zero()});
    ASSERT_EQ(history.latest().specific_force_m_s2.x(), i);
    ASSERT_EQ(history[history.begin()].specific_force_m_s2.x(), static_cast<double>(history.begin()));
    ASSERT_LE(history[history.begin()].stamp_ns, std::max(i * 250'000LL - 2'000'000'000LL + 500'000LL, 0LL));
  }
  EXPECT_FALSE(history.is_short());
}

// --- standing ---

const std::vector<SimulatedDrive::Leg> kDriveOf90s = {{5, 0, 0},     {15, 4, 0},   {10, 4, 0.4},  {10, 6, 0},
                                                      {10, 6, -0.4}, {15, 3, 0.2}, {15, 5, -0.1}, {10, 5, 0.3}};

struct Standing {
  double yaw_nees = 0.0;       ///< of each run the mean after setting off, their mean
  double far_while_ready = 0;  ///< share of the poses while it stands, beyond 3 sigma
  int runs = 0, ready = 0;     ///< again or at last, after setting off
  double stood_ready_s = 0.0;
};

/// A vehicle that drives for 90 s first, or not, stands and sets off. At rest nothing shows the yaw.
Standing stand(int seeds, double stands_s, bool drives_first, double sideslip_sigma_m_s) {
  Standing result;
  double poses = 0.0, far = 0.0;
  for (int seed = 0; seed < seeds; ++seed) {
    SimulatedDrive drive;
    drive.initial_yaw_rad = 0.77 * seed;
    if (drives_first) drive.legs = kDriveOf90s;
    drive.legs.push_back({stands_s, 0.0, 0.0});
    const double begin_s = drives_first ? 90.0 : 0.0, end_s = begin_s + stands_s;
    drive.legs.insert(drive.legs.end(),
                      {{15, 4, 0}, {10, 4, 0.4}, {10, 6, 0}, {10, 6, -0.4}, {15, 3, 0.2}, {1e9, 5, -0.3}});
    FlightSensors sensors;
    sensors.imu_rate_hz = 25.0;
    sensors.correlated_share = 0.0;
    GpsInsParams params;
    params.sideslip_sigma_m_s = sideslip_sigma_m_s;
    DriveRun run(drive, sensors, static_cast<std::uint64_t>(seed));
    GpsIns ins(params, {});
    double nees = 0.0, count = 0.0;
    for (; run.time_s() < end_s + 100.0; run.next()) {
      ins.add_imu(run.sample());
      if (!run.has_fix()) continue;
      ins.add_position(run.stamp_ns(), run.fix(), run.fix_covariance());
      const GpsInsPose pose = ins.pose();
      if (!pose.is_ready) continue;
      const double variance = yaw_variance(pose), error = yaw_error(run.T_world_base(), pose);
      EXPECT_LE(std::sqrt(variance), 1.05 * params.max_yaw_sigma_rad);
      if (run.time_s() > begin_s && run.time_s() < end_s) {
        ++poses;
        if (error * error > 9.0 * variance) ++far;
        result.stood_ready_s += 1.0 / sensors.fix_rate_hz / seeds;
      } else if (run.time_s() > end_s) {
        nees += error * error / variance;
        ++count;
      }
    }
    ++result.runs;
    if (!ins.is_ready()) continue;
    ++result.ready;
    result.yaw_nees += nees / count;
  }
  result.yaw_nees /= result.ready;
  result.far_while_ready = poses > 0.0 ? far / poses : 0.0;
  return result;
}

void expect_honest(const Standing& result, bool drives_first) {
  EXPECT_EQ(result.ready, result.runs);
  EXPECT_GT(result.yaw_nees, band_95(result.ready).first);
  EXPECT_LT(result.yaw_nees, band_95(result.ready).second);
  EXPECT_LE(result.far_while_ready, 0.02);
  if (drives_first) {
    EXPECT_GT(result.stood_ready_s, 60.0) << "a short stop is no reason to lose the yaw";
  } else {
    EXPECT_EQ(result.stood_ready_s, 0.0) << "nothing has shown the yaw yet";
  }
  ::testing::Test::RecordProperty("yaw_nees", std::to_string(result.yaw_nees));
}

TEST(GpsInsStanding, WhatIsNotObservedDoesNotGetCertain) {
  for (const bool drives_first : {true, false}) {
    for (const double sideslip_sigma_m_s : {0.0, 0.1}) {
      SCOPED_TRACE(std::to_string(drives_first) + " " + std::to_string(sideslip_sigma_m_s));
      expect_honest(stand(6, 600.0, drives_first, sideslip_sigma_m_s), drives_first);
    }
  }
}

TEST(GpsInsStandingLong, WhatIsNotObservedDoesNotGetCertainInAnHour) {
  for (const bool drives_first : {true, false}) expect_honest(stand(50, 3600.0, drives_first, 0.0), drives_first);
}

/// Shaken as by an engine that idles, in the axes of the IMU.
InertialSample shaken(InertialSample sample) {
  const double t_s = 1e-9 * static_cast<double>(sample.stamp_ns);
  for (int k = 0; k < 3; ++k) {
    sample.angular_velocity_rad_s(k) += 0.05 * std::sin(2.0 * kPi * 31.7 * t_s + k);
    sample.specific_force_m_s2(k) += 0.5 * std::sin(2.0 * kPi * 43.3 * t_s + 2.0 * k);
  }
  return sample;
}

struct AtRest {
  double nees = 0.0, greatest_sigma_rad = 0.0;  ///< of the yaw
  int ready = 0;
};

/// A vehicle that drives for 90 s and stands, on a table that turns by up to `turn_rad_s`; after each of `times_s`.
std::vector<AtRest> rest(int seeds, double standing_turn_rad_s, double turn_rad_s, const std::vector<double>& times_s,
                         bool is_shaken = false) {
  std::vector<AtRest> results(times_s.size());
  for (int seed = 0; seed < seeds; ++seed) {
    SimulatedDrive drive;
    drive.initial_yaw_rad = 0.77 * seed;
    drive.legs = kDriveOf90s;
    drive.legs.push_back({1e9, 0.0, turn_rad_s * (2.0 * (seed + 0.5) / seeds - 1.0)});
    FlightSensors sensors;
    sensors.imu_rate_hz = is_shaken ? 200.0 : 25.0;
    sensors.correlated_share = 0.0;
    GpsInsParams params;
    params.standing_turn_rad_s = standing_turn_rad_s;
    DriveRun run(drive, sensors, static_cast<std::uint64_t>(500 + seed));
    GpsIns ins(params, {});
    for (std::size_t i = 0; i < times_s.size(); run.next()) {
      ins.add_imu(is_shaken && run.time_s() > 95.0 ? shaken(run.sample()) : run.sample());
      if (!run.has_fix()) continue;
      ins.add_position(run.stamp_ns(), run.fix(), run.fix_covariance());
      if (run.time_s() < 90.0 + times_s[i]) continue;
      AtRest& result = results[i++];
      const GpsInsPose pose = ins.pose();
      if (!pose.is_ready) continue;
      ++result.ready;
      const double variance = yaw_variance(pose);
      result.nees += std::pow(yaw_error(run.T_world_base(), pose), 2) / variance;
      result.greatest_sigma_rad = std::max(result.greatest_sigma_rad, std::sqrt(variance));
      EXPECT_LE(std::sqrt(variance), 1.05 * params.max_yaw_sigma_rad);
    }
  }
  for (AtRest& result : results) result.nees /= result.ready;
  return results;
}

void expect_known(const std::vector<AtRest>& results, int seeds, bool turns, const std::string& what) {
  for (std::size_t i = 0; i < results.size(); ++i) {
    SCOPED_TRACE(what + ", time " + std::to_string(i));
    EXPECT_EQ(results[i].ready, seeds);
    EXPECT_LT(results[i].nees, band_95(seeds).second);
    // The sigma allows for a turn, so that the yaw of something that does not turn is known better than is said.
    if (turns) {
      EXPECT_GT(results[i].nees, band_95(seeds).first);
    }
    ::testing::Test::RecordProperty(what + std::to_string(i), std::to_string(results[i].nees) + " " +
                                                                  std::to_string(results[i].greatest_sigma_rad));
  }
}

// At rest the gyroscope measures its bias. What it stands on may turn by less than can be seen.
TEST(GpsInsStanding, TheYawStaysKnownAsFarAsIsHonest) {
  constexpr int kSeeds = 20;
  constexpr double kTurn_rad_s = 0.0003;
  const std::vector<double> minutes_s = {60.0, 180.0, 360.0};
  expect_known(rest(kSeeds, kTurn_rad_s, 0.0, minutes_s), kSeeds, false, "still");
  expect_known(rest(kSeeds, kTurn_rad_s, kTurn_rad_s, minutes_s), kSeeds, true, "turntable");
  expect_known(rest(6, kTurn_rad_s, 0.0, {60.0, 180.0}, true), 6, false, "shaken");
}

TEST(GpsInsStanding, WhereNothingTurnsTheYawStaysKnownForLonger) {
  constexpr int kSeeds = 12;
  constexpr double kTurn_rad_s = 0.00003;
  const std::vector<double> minutes_s = {60.0, 180.0, 600.0};
  expect_known(rest(kSeeds, kTurn_rad_s, 0.0, minutes_s), kSeeds, false, "still");
  // So small a turn is less than what the parameters say of the noise, more than this IMU has.
  expect_known(rest(kSeeds, kTurn_rad_s, kTurn_rad_s, minutes_s), kSeeds, false, "turntable");
}

// A table that begins to turn while a vehicle stands on it, fast enough to be seen.
TEST(GpsInsStanding, ATurnThatBeginsAtRestIsSeen) {
  for (const double rate_rad_s : {0.0008, -0.002, 0.01, -0.1}) {
    for (int seed = 0; seed < 8; ++seed) {
      SimulatedDrive drive;
      drive.legs = kDriveOf90s;
      drive.legs.push_back({100.0 + seed, 0.0, 0.0});
      drive.legs.push_back({200.0, 0.0, rate_rad_s});
      FlightSensors sensors;
      sensors.imu_rate_hz = 25.0;
      sensors.correlated_share = 0.0;
      DriveRun run(drive, sensors, static_cast<std::uint64_t>(900 + seed));
      GpsIns ins({}, {});
      double greatest = 0.0;
      for (; run.time_s() < 360.0; run.next()) {
        ins.add_imu(run.sample());
        if (!run.has_fix()) continue;
        ins.add_position(run.stamp_ns(), run.fix(), run.fix_covariance());
        const GpsInsPose pose = ins.pose();
        if (!pose.is_ready || run.time_s() < 185.0) continue;
        greatest = std::max(greatest, std::pow(yaw_error(run.T_world_base(), pose), 2) / yaw_variance(pose));
      }
      EXPECT_LT(greatest, 16.0) << rate_rad_s << ", seed " << seed;
    }
  }
}

/// It holds its place to half a metre, and its yaw to 0.1 rad.
struct Hovering {
  double phase = 0.0;

  static double turned(double t_s) { return 0.1 * std::sin(0.05 * t_s); }
  Eigen::Vector3d velocity(double t_s) const {
    return {0.05 * std::cos(0.1 * t_s + phase), 0.04 * std::cos(0.13 * t_s), 0.0};
  }
  Eigen::Quaterniond attitude(double t_s) const {
    return Eigen::Quaterniond(Eigen::AngleAxisd(phase + turned(t_s), Eigen::Vector3d::UnitZ()) *
                              Eigen::AngleAxisd(0.002 * std::sin(0.4 * t_s + phase), Eigen::Vector3d::UnitX()));
  }
  Eigen::Vector3d angular_velocity_body(double t_s) const {
    constexpr double kStep_s = 1e-3;
    return log_so3(attitude(t_s - kStep_s).conjugate() * attitude(t_s + kStep_s)) / (2.0 * kStep_s);
  }
  Eigen::Vector3d specific_force_body(double t_s) const {
    const Eigen::Vector3d acceleration_m_s2(-0.005 * std::sin(0.1 * t_s + phase), -0.0052 * std::sin(0.13 * t_s), 0.0);
    return attitude(t_s).conjugate() * (acceleration_m_s2 + kStandardGravity_m_s2 * Eigen::Vector3d::UnitZ());
  }
};

// The yaw is given at first, and then by the gyroscope alone.
TEST(GpsInsStanding, AVehicleThatHoversDoesNotStand) {
  double nees = 0.0;
  constexpr int kSeeds = 12;
  for (int seed = 0; seed < kSeeds; ++seed) {
    FlightSensors sensors;
    sensors.imu_rate_hz = 50.0;
    sensors.correlated_share = 0.0;
    MotionRun<Hovering> run({0.5 * seed}, sensors, static_cast<std::uint64_t>(seed));
    Random random(static_cast<std::uint64_t>(50 + seed));
    GpsIns ins({}, {});
    double last = 0.0;
    for (; run.time_s() < 260.0; run.next()) {
      ins.add_imu(run.sample());
      if (!run.has_fix()) continue;
      ins.add_position(run.stamp_ns(), run.fix(), run.fix_covariance());
      if (run.time_s() < 120.0) {
        ins.add_heading(run.stamp_ns(), wrap_to_pi(base_yaw(run.T_world_base()) + 0.02 * random.normal()), 0.02);
      }
      const GpsInsPose pose = ins.pose();
      if (!pose.is_ready || run.time_s() < 120.0) continue;
      last = std::pow(yaw_error(run.T_world_base(), pose), 2) / yaw_variance(pose);
      EXPECT_LT(last, 16.0) << seed << ", " << run.time_s();
    }
    nees += last / kSeeds;
  }
  EXPECT_LT(nees, band_95(kSeeds).second);
}

// --- outages ---

/// Carried by hand: it is tilted to and fro by 0.4 rad, so that an error of the accelerometer's scale and axes is not a
/// constant bias.
struct CarriedByHand {
  double phase = 0.0;

  static constexpr double kStep_s = 1e-3;
  Eigen::Vector3d position(double t_s) const {
    return {15.0 * std::sin(0.12 * t_s), 10.0 * std::sin(0.24 * t_s),
            0.04 * std::sin(11.3 * t_s) + 0.3 * std::sin(0.5 * t_s) + 0.1 * std::sin(1.26 * t_s + phase)};
  }
  Eigen::Vector3d velocity(double t_s) const {
    return (position(t_s + kStep_s) - position(t_s - kStep_s)) / (2.0 * kStep_s);
  }
  Eigen::Quaterniond attitude(double t_s) const {
    const Eigen::Vector3d v = velocity(t_s);
    const double pitch = 0.25 * std::sin(0.35 * t_s + phase) + 0.08 * std::sin(5.65 * t_s);
    const double roll = 0.3 * std::sin(0.23 * t_s + 2.0 * phase) + 0.06 * std::sin(5.65 * t_s + 1.0);
    return Eigen::AngleAxisd(std::atan2(v.y(), v.x()), Eigen::Vector3d::UnitZ()) *
           Eigen::AngleAxisd(pitch, Eigen::Vector3d::UnitY()) * Eigen::AngleAxisd(roll, Eigen::Vector3d::UnitX());
  }
  Eigen::Vector3d angular_velocity_body(double t_s) const {
    return log_so3(attitude(t_s - kStep_s).conjugate() * attitude(t_s + kStep_s)) / (2.0 * kStep_s);
  }
  Eigen::Vector3d specific_force_body(double t_s) const {
    const Eigen::Vector3d acceleration =
        (position(t_s + kStep_s) - 2.0 * position(t_s) + position(t_s - kStep_s)) / (kStep_s * kStep_s);
    return attitude(t_s).conjugate() * (acceleration + kStandardGravity_m_s2 * Eigen::Vector3d::UnitZ());
  }
};

struct Outages {
  Eigen::Vector3d nees = Eigen::Vector3d::Zero();  ///< of each axis at the end of outages, mean
  double after_m = 0.0;                            ///< root mean square of the distance a second after
  std::size_t refused = 0;                         ///< right fixes after outages
  int count = 0;
};

/// Fixes of 2 cm, and outages of them.
Outages go_through_outages(int seeds, double outage_s, double scale_sigma) {
  Outages result;
  int after = 0;
  for (int seed = 0; seed < seeds; ++seed) {
    FlightSensors sensors;
    sensors.imu_rate_hz = 100.0;
    sensors.correlated_share = 0.0;
    sensors.fix_sigma_m = 0.02;
    Random random(static_cast<std::uint64_t>(77 + seed));
    Eigen::Matrix3d scale = Eigen::Matrix3d::Identity();
    for (int k = 0; k < 3; ++k) scale.col(k) += scale_sigma * normal_vector<3>(random);
    MotionRun<CarriedByHand> run({static_cast<double>(seed)}, sensors, static_cast<std::uint64_t>(seed));
    GpsIns ins({}, {});
    const double period_s = outage_s + 30.0;
    for (; run.time_s() < 60.0 + 3.0 * period_s; run.next()) {
      InertialSample sample = run.sample();
      sample.specific_force_m_s2 = scale * sample.specific_force_m_s2;
      ins.add_imu(sample);
      if (!run.has_fix()) continue;
      const Eigen::Vector3d fix = run.fix();
      const double in_period_s = run.time_s() < 60.0 ? period_s : std::fmod(run.time_s() - 60.0, period_s);
      if (in_period_s < outage_s) {
        if (in_period_s < outage_s - 0.21) continue;
        const GpsInsPose pose = ins.pose();
        EXPECT_TRUE(pose.is_ready) << pose.reason;
        const Eigen::Vector3d error_m = pose.T_world_base.translation() - run.T_world_base().translation();
        result.nees += error_m.cwiseAbs2().cwiseQuotient(pose.covariance.diagonal().head<3>());
        ++result.count;
        continue;
      }
      const auto before = ins.counters().of("fix outside its gate");
      ins.add_position(run.stamp_ns(), fix, run.fix_covariance());
      if (in_period_s < period_s) result.refused += ins.counters().of("fix outside its gate") - before;
      if (std::abs(in_period_s - outage_s - 1.0) < 0.11) {
        result.after_m += (ins.pose().T_world_base.translation() - run.T_world_base().translation()).squaredNorm();
        ++after;
      }
    }
  }
  result.nees /= result.count;
  result.after_m = std::sqrt(result.after_m / after);
  return result;
}

TEST(GpsInsOutages, TheFirstGoodFixesAfterwardsAreUsed) {
  for (const double outage_s : {5.0, 10.0, 30.0, 60.0}) {
    for (const double scale_sigma : {0.0, 0.005}) {
      SCOPED_TRACE(std::to_string(outage_s) + " s, scale " + std::to_string(scale_sigma));
      const Outages result = go_through_outages(3, outage_s, scale_sigma);
      RecordProperty("nees_z_" + std::to_string(outage_s) + "_" + std::to_string(scale_sigma),
                     std::to_string(result.nees.z()));
      EXPECT_LE(result.refused, static_cast<std::size_t>(result.count)) << "one after each outage at most";
      EXPECT_LT(result.after_m, 0.25);
      // Of independent outages; where the accelerometer has a scale it is not white noise, and that of the vertical
      // must be no less sure than the others.
      const double most = scale_sigma > 0.0 ? 4.0 : band_95(result.count).second;
      EXPECT_LT(result.nees.z(), most);
    }
  }
}

// --- anything ---

TEST(GpsInsFaults, WhateverComesTheEstimateStaysOneAndIsGoodAgainAfterwards) {
  for (std::uint64_t seed = 0; seed < 30; ++seed) {
    GpsInsParams params;
    SimulatedFlight flight;
    if (seed % 3 == 0) {
      params.sideslip_sigma_m_s = 1.0;
      flight.wind_m_s.setZero();
    }
    FlightRun run(flight, {}, seed);
    Random random(100 + seed);
    GpsIns ins(params, {});
    const auto odd_matrix = [&] {
      Eigen::Matrix3d m = Eigen::Matrix3d::Identity();
      for (int k = 0; k < 3; ++k) m(static_cast<int>(random.uniform(0.0, 3.0)) % 3, k) = odd_number(random);
      return m;
    };
    const auto odd_stamp = [&] {
      return random.uniform(0.0, 1.0) < 0.7 ? run.stamp_ns() - nanoseconds(random.uniform(0.0, 1.2))
                                            : static_cast<std::int64_t>(9e18 * random.uniform(-1.0, 1.0));
    };
    bool was_good_for_10_s = false;
    for (; run.time_s() < 150.0; run.next()) {
      const bool is_hostile = run.time_s() > 30.0 && run.time_s() < 60.0;
      ins.add_imu(run.sample());
      if (is_hostile && random.uniform(0.0, 1.0) < 0.2) {
        switch (static_cast<int>(random.uniform(0.0, 6.0))) {
          case 0: {
            InertialSample sample = run.sample();
            sample.stamp_ns += 1;
            sample.specific_force_m_s2(static_cast<int>(random.uniform(0.0, 3.0)) % 3) = odd_number(random);
            sample.angular_velocity_rad_s(static_cast<int>(random.uniform(0.0, 3.0)) % 3) = odd_number(random);
            ins.add_imu(sample);
            break;
          }
          case 1:
            ins.add_position(odd_stamp(), run.antenna() + odd_number(random) * normal_vector<3>(random),
                             run.fix_covariance());
            break;
          case 2:
            ins.add_position(odd_stamp(), run.antenna(), odd_matrix());
            break;
          case 3:
            ins.add_altitude(odd_stamp(), odd_number(random), odd_number(random));
            break;
          case 4:
            ins.add_heading(odd_stamp(), odd_number(random), odd_number(random));
            break;
          default: {
            GpsInsCorrection correction;
            correction.stamp_ns = odd_stamp();
            correction.rows = static_cast<int>(random.uniform(-1.0, 8.0));
            correction.residual(0) = odd_number(random);
            correction.H(0, static_cast<int>(random.uniform(0.0, 18.0)) % 18) = odd_number(random);
            correction.R.topLeftCorner<3, 3>() = odd_matrix();
            ins.correct(correction);
          }
        }
      }
      if (!run.has_fix()) continue;
      ins.add_position(run.stamp_ns(), run.fix(), run.fix_covariance());
      const GpsInsPose pose = ins.pose();
      Estimate<GpsInsState> estimate;
      if (pose.is_ready) {
        ASSERT_TRUE(pose.T_world_base.matrix().allFinite()) << seed << ", " << run.time_s();
        ASSERT_TRUE(is_covariance(pose.covariance)) << seed << ", " << run.time_s();
        ASSERT_TRUE(ins.state_at(pose.stamp_ns, estimate));
        ASSERT_TRUE(is_covariance(estimate.P)) << seed << ", " << run.time_s();
      }
      if (was_good_for_10_s || run.time_s() < 70.0) continue;
      was_good_for_10_s = true;
      // After 10 s of good input the place is no worse than by a single fix, and the yaw as good as it says. It is seen
      // by changes of the velocity alone: where the pose began anew, and has not turned since, it does not know it.
      if (pose.is_ready) {
        EXPECT_LT(std::abs(yaw_error(run.T_world_base(), pose)), 3.5 * std::sqrt(yaw_variance(pose))) << seed;
        const Eigen::Vector3d error_m = run.T_world_base().translation() - pose.T_world_base.translation();
        EXPECT_LT(mahalanobis2(error_m, run.fix_covariance()), chi_square_quantile(0.9999, 3)) << seed;
      } else {
        EXPECT_EQ(std::string(pose.reason).rfind("yaw is not known", 0), 0u) << seed << ": " << pose.reason;
      }
    }
    // Good input for 90 s, since a pose that began anew needs turns to know the yaw.
    const GpsInsPose pose = ins.pose();
    ASSERT_TRUE(pose.is_ready) << seed << ": " << pose.reason;
    const Eigen::Vector3d error_m = run.T_world_base().translation() - pose.T_world_base.translation();
    EXPECT_LT(error_m.norm(), 8.0) << seed;
  }
}

}  // namespace
}  // namespace situation_awareness::gps_ins_faults_test

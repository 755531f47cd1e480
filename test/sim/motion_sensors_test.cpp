// SPDX-License-Identifier: BSD-3-Clause
// Sensors of the robot's own motion: IMU, GNSS and wheel odometry.
#include <cmath>
#include <cstdint>
#include <stdexcept>
#include <string>
#include <vector>

#include <gtest/gtest.h>

#include "sim/world_file.hpp"
#include "situation_awareness/geometry/angles.hpp"
#include "situation_awareness/sim/sensors.hpp"
#include "situation_awareness/sim/standing_error.hpp"
#include "support/consistency.hpp"
#include "support/refusal.hpp"

namespace situation_awareness::motion_sensors_test {
namespace {

SimulatedImuParams exact_imu() {
  SimulatedImuParams params;
  params.gyroscope_noise = params.gyroscope_bias_sigma_rad_s = params.gyroscope_bias_walk = 0.0;
  params.accelerometer_noise = params.accelerometer_bias_sigma_m_s2 = params.accelerometer_bias_walk = 0.0;
  return params;
}

Eigen::Isometry3d some_mount() {
  Eigen::Isometry3d T(Eigen::AngleAxisd(0.7, Eigen::Vector3d(0.2, -0.5, 0.8).normalized()));
  T.translation() << 0.12, -0.07, 0.05;
  return T;
}

/// A robot that is driven along x at 1 m/s, or as the text says.
std::string driven(const std::string& path = "straight from 0 0 velocity 1 0") {
  return world_text(kRobot, "<text name=\"robot\" data=\"" + path + "\"/>");
}

/// Four standard deviations of a variance that n normal numbers give.
void expect_variance(double sum_of_squares, int n, double variance) {
  EXPECT_NEAR(sum_of_squares / n, variance, 4.0 * variance * std::sqrt(2.0 / n));
}

// --- IMU ------------------------------------------------------------------------------------------------------------

TEST(SimulatedImu, AtRestMeasuresGravityAndItsNoise) {
  const WorldFile file(world_text(
      "<body name=\"robot\" mocap=\"true\" pos=\"1 2 1.5\" euler=\"0.3 -0.2 1\"><site name=\"lidar\"/></body>"));
  const World world(file.path());
  const Eigen::Matrix3d R_world_imu = world.robot_at(0.0).T_world_robot.linear() * some_mount().linear();
  SimulatedImu exact(world, some_mount(), exact_imu(), 1);
  for (int i = 0; i < 10; ++i) {
    const ImuSample sample = exact.next();
    EXPECT_EQ(sample.stamp_ns, 5'000'000 * i);
    EXPECT_LT((R_world_imu * sample.specific_force_imu_m_s2 - Eigen::Vector3d(0, 0, 9.80665)).norm(), 1e-9);
    EXPECT_LT(sample.angular_velocity_imu_rad_s.norm(), 1e-9);
  }
  SimulatedImuParams params = exact_imu();
  params.gyroscope_noise = 1e-3;
  params.accelerometer_noise = 0.02;
  SimulatedImu noisy(world, some_mount(), params, 5);
  double gyroscope = 0.0, accelerometer = 0.0;
  constexpr int kSamples = 4000;
  for (int i = 0; i < kSamples; ++i) {
    const ImuSample sample = noisy.next();
    gyroscope += sample.angular_velocity_imu_rad_s.squaredNorm();
    accelerometer += (R_world_imu * sample.specific_force_imu_m_s2 - Eigen::Vector3d(0, 0, 9.80665)).squaredNorm();
  }
  expect_variance(gyroscope, 3 * kSamples, 1e-6 * 200.0);  // density^2 times rate
  expect_variance(accelerometer, 3 * kSamples, 4e-4 * 200.0);
}

void expect_integrates_to_the_truth(const World& world) {
  SimulatedImu imu(world, some_mount(), exact_imu(), 1);
  const double h = 1.0 / imu.params().rate_hz;
  const auto T_world_imu = [&](double t) { return world.robot_at(t).T_world_robot * some_mount(); };
  const auto velocity = [&](double t) -> Eigen::Vector3d {
    constexpr double kStep_s = 1e-5;
    return (T_world_imu(t + kStep_s).translation() - T_world_imu(t - kStep_s).translation()) / (2.0 * kStep_s);
  };
  constexpr double kStart_s = 1.0;
  while (imu.next_time_s() < kStart_s + 0.5 * h) imu.next();
  double t = kStart_s + 0.5 * h;
  Eigen::Matrix3d R = T_world_imu(t).linear();
  Eigen::Vector3d p = T_world_imu(t).translation(), v = velocity(t);
  for (; t < kStart_s + 20.0; t += h) {
    const ImuSample sample = imu.next();
    const auto turned = [&](double part) -> Eigen::Matrix3d {
      const Eigen::Vector3d rotation = part * h * sample.angular_velocity_imu_rad_s;
      return R * Eigen::AngleAxisd(rotation.norm(), rotation.normalized()).toRotationMatrix();
    };
    const Eigen::Vector3d a = turned(0.5) * sample.specific_force_imu_m_s2 - Eigen::Vector3d(0, 0, 9.80665);
    p += h * v + 0.5 * h * h * a;
    v += h * a;
    R = turned(1.0);
  }
  EXPECT_LT((R - T_world_imu(t).linear()).norm(), 1e-6);
  EXPECT_LT((v - velocity(t)).norm(), 2e-3);
  EXPECT_LT((p - T_world_imu(t).translation()).norm(), 0.02);
}

TEST(SimulatedImu, IntegratesToTheTruth) {
  const WorldFile file(kBriskWorld);
  expect_integrates_to_the_truth(World(file.path()));
  expect_integrates_to_the_truth(World(kWorlds + "lab.xml"));
}

TEST(SimulatedImu, ItsBiasesStartAndWalkAsParameterised) {
  const WorldFile file(world_text(kRobot));
  const World world(file.path());
  SimulatedImuParams params = exact_imu();
  params.rate_hz = 20.0;
  params.gyroscope_bias_sigma_rad_s = 0.01;
  params.gyroscope_bias_walk = 0.004;
  params.accelerometer_bias_sigma_m_s2 = 0.1;
  params.accelerometer_bias_walk = 0.03;
  constexpr int kSeeds = 400;
  double start_g = 0.0, start_a = 0.0, later_g = 0.0, later_a = 0.0;
  for (int seed = 0; seed < kSeeds; ++seed) {
    SimulatedImu imu(world, Eigen::Isometry3d::Identity(), params, static_cast<std::uint64_t>(seed));
    const ImuSample first = imu.next();
    EXPECT_LT((first.angular_velocity_imu_rad_s - first.gyroscope_bias_rad_s).norm(), 1e-9);
    ImuSample last = first;
    while (imu.next_time_s() < 10.01) last = imu.next();
    start_g += first.gyroscope_bias_rad_s.squaredNorm();
    start_a += first.accelerometer_bias_m_s2.squaredNorm();
    later_g += (last.gyroscope_bias_rad_s - first.gyroscope_bias_rad_s).squaredNorm();
    later_a += (last.accelerometer_bias_m_s2 - first.accelerometer_bias_m_s2).squaredNorm();
  }
  expect_variance(start_g, 3 * kSeeds, 1e-4);
  expect_variance(start_a, 3 * kSeeds, 1e-2);
  expect_variance(later_g, 3 * kSeeds, 10.0 * 1.6e-5);
  expect_variance(later_a, 3 * kSeeds, 10.0 * 9e-4);
}

// --- GNSS -----------------------------------------------------------------------------------------------------------

TEST(SimulatedGnss, ItsNoiseIsCorrelatedAsParameterised) {
  const WorldFile file(driven());
  const World world(file.path());
  SimulatedGnssParams params;
  params.correlated_sigma_m = 1.5;
  params.correlation_s = 4.0;
  params.white_sigma_m = 0.5;
  params.vertical_ratio = 2.0;
  constexpr int kSeeds = 2000, kLag = 10;  // of 2 s
  double now = 0.0, vertical = 0.0, lagged = 0.0, next = 0.0;
  for (int seed = 0; seed < kSeeds; ++seed) {
    SimulatedGnss gnss(world, some_mount(), params, static_cast<std::uint64_t>(seed));
    std::vector<Eigen::Vector3d> errors;
    for (int i = 0; i <= kLag; ++i) {
      const double t = gnss.next_time_s();
      const GnssFix fix = gnss.next();
      EXPECT_EQ(fix.stamp_ns, 200'000'000 * i);
      errors.push_back(fix.position_world_m - (world.robot_at(t).T_world_robot * some_mount()).translation());
      EXPECT_TRUE(fix.covariance_m2.isApprox(Eigen::Vector3d(2.5, 2.5, 10.0).asDiagonal().toDenseMatrix(), 1e-12));
    }
    now += errors[0].head<2>().squaredNorm();
    vertical += errors[0].z() * errors[0].z();
    next += errors[0].head<2>().dot(errors[1].head<2>());
    lagged += errors[0].head<2>().dot(errors[kLag].head<2>());
  }
  expect_variance(now, 2 * kSeeds, 2.25 + 0.25);
  expect_variance(vertical, kSeeds, 4.0 * 2.5);
  // A product of two numbers of variance s^2 and covariance c has the variance s^4 + c^2.
  const auto expect_covariance = [](double sum, double covariance) {
    EXPECT_NEAR(sum / (2 * kSeeds), covariance, 4.0 * std::sqrt((6.25 + covariance * covariance) / (2 * kSeeds)));
  };
  expect_covariance(next, 2.25 * std::exp(-0.2 / 4.0));
  expect_covariance(lagged, 2.25 * std::exp(-2.0 / 4.0));
}

// --- odometry -------------------------------------------------------------------------------------------------------

SimulatedOdometryParams exact_odometry() {
  SimulatedOdometryParams params;
  params.distance_noise = params.yaw_noise_of_distance = params.yaw_noise_of_yaw = 0.0;
  params.distance_scale_sigma = params.yaw_scale_sigma = 0.0;
  return params;
}

TEST(SimulatedOdometry, WithoutNoiseIsTheTruthFromTheStartOn) {
  const WorldFile file(driven("circle center 1 2 radius 2 rate 0.6 tangent"));
  const World world(file.path());
  SimulatedOdometry odometry(world, Eigen::Isometry3d::Identity(), exact_odometry(), 1);
  const auto pose = [&](double t) -> Pose2 {
    const Eigen::Isometry3d T = world.robot_at(t).T_world_robot;
    return {T.translation().head<2>(), std::atan2(T(1, 0), T(0, 0))};
  };
  for (int i = 0; i < 1000; ++i) {
    const double t = odometry.next_time_s();
    const OdometrySample sample = odometry.next();
    const Pose2 truth = inverse(pose(0.0)) * pose(t);
    ASSERT_LT((sample.T_odom_base.translation_m - truth.translation_m).norm(), 1e-9);
    ASSERT_NEAR(wrap_to_pi(sample.T_odom_base.yaw_rad - truth.yaw_rad), 0.0, 1e-9);
    if (i == 0) continue;
    ASSERT_NEAR(sample.velocity_base_m_s.norm(), 1.2, 1e-3);
    ASSERT_NEAR(sample.yaw_rate_rad_s, 0.6, 1e-9);
  }
}

TEST(SimulatedOdometry, DriftsAsParameterisedOnAStraightPath) {
  const WorldFile file(driven());
  const World world(file.path());
  SimulatedOdometryParams params = exact_odometry();
  params.distance_noise = 0.02;
  params.yaw_noise_of_distance = 0.01;
  constexpr int kSeeds = 600;
  constexpr double kWay_m = 9.0;
  double along = 0.0, across = 0.0, yaw = 0.0;
  for (int seed = 0; seed < kSeeds; ++seed) {
    SimulatedOdometry odometry(world, Eigen::Isometry3d::Identity(), params, static_cast<std::uint64_t>(seed));
    OdometrySample last;
    while (odometry.next_time_s() < kWay_m + 0.01) last = odometry.next();
    along += std::pow(last.T_odom_base.translation_m.x() - kWay_m, 2);
    across += std::pow(last.T_odom_base.translation_m.y(), 2);
    yaw += std::pow(last.T_odom_base.yaw_rad, 2);
  }
  // Random walks over the way: of the distance, of the yaw, and the yaw's integral. What a turned way loses in length,
  // half the yaw's square, is below 1 % of the distance's sigma.
  expect_variance(along, kSeeds, 4e-4 * kWay_m);
  expect_variance(yaw, kSeeds, 1e-4 * kWay_m);
  expect_variance(across, kSeeds, 1e-4 * std::pow(kWay_m, 3) / 3.0);
}

TEST(SimulatedOdometry, DriftsAsParameterisedWhileItTurns) {
  const WorldFile file(driven("stand spin 0.5"));
  const World world(file.path());
  SimulatedOdometryParams params = exact_odometry();
  params.yaw_noise_of_yaw = 0.02;
  params.yaw_scale_sigma = 0.03;
  constexpr int kSeeds = 600;
  double yaw = 0.0;
  for (int seed = 0; seed < kSeeds; ++seed) {
    SimulatedOdometry odometry(world, Eigen::Isometry3d::Identity(), params, static_cast<std::uint64_t>(seed));
    OdometrySample last;
    while (odometry.next_time_s() < 4.01) last = odometry.next();
    EXPECT_LT(last.T_odom_base.translation_m.norm(), 1e-9);
    yaw += std::pow(wrap_to_pi(last.T_odom_base.yaw_rad - 2.0), 2);
  }
  expect_variance(yaw, kSeeds, 4e-4 * 2.0 + std::pow(0.03 * 2.0, 2));
}

TEST(SimulatedOdometry, TurnsByTheDriftOfItsWheels) {
  const WorldFile file(driven());
  const World world(file.path());
  SimulatedOdometryParams params = exact_odometry();
  params.yaw_drift_sigma = 0.005;
  constexpr int kSeeds = 600;
  double yaw = 0.0;
  for (int seed = 0; seed < kSeeds; ++seed) {
    SimulatedOdometry odometry(world, Eigen::Isometry3d::Identity(), params, static_cast<std::uint64_t>(seed));
    OdometrySample half, last;
    while (odometry.next_time_s() < 3.01) half = odometry.next();
    while (odometry.next_time_s() < 6.01) last = odometry.next();
    EXPECT_NEAR(last.T_odom_base.yaw_rad, 2.0 * half.T_odom_base.yaw_rad, 1e-9);  // constant
    yaw += std::pow(last.T_odom_base.yaw_rad, 2);
  }
  expect_variance(yaw, kSeeds, std::pow(0.005 * 6.0, 2));
}

TEST(SimulatedOdometry, StatesTheCovarianceOfItsDrift) {
  const WorldFile file(driven("circle center 0 0 radius 2 rate 0.5 tangent"));
  const World world(file.path());
  SimulatedOdometryParams params;
  params.distance_scale_sigma = 0.02;
  params.yaw_scale_sigma = 0.03;
  params.yaw_drift_sigma = 0.01;
  SimulatedOdometry exact(world, Eigen::Isometry3d::Identity(), exact_odometry(), 0);
  OdometrySample truth;
  while (exact.next_time_s() < 6.01) truth = exact.next();
  EXPECT_LT(truth.pose_covariance.norm() + truth.twist_covariance.norm(), 1e-12);
  ChiSquareSum pose, twist;
  for (int seed = 0; seed < 400; ++seed) {
    SimulatedOdometry odometry(world, Eigen::Isometry3d::Identity(), params, static_cast<std::uint64_t>(seed));
    OdometrySample last;
    while (odometry.next_time_s() < 6.01) last = odometry.next();
    Eigen::Vector3d error;
    error << last.T_odom_base.translation_m - truth.T_odom_base.translation_m,
        wrap_to_pi(last.T_odom_base.yaw_rad - truth.T_odom_base.yaw_rad);
    pose.add(error.dot(last.pose_covariance.ldlt().solve(error)), 3);
    // The velocity's error is along the motion alone.
    const Eigen::Vector2d along = truth.velocity_base_m_s.normalized();
    const double speed_error = (last.velocity_base_m_s - truth.velocity_base_m_s).dot(along);
    const double speed_variance = along.dot(last.twist_covariance.topLeftCorner<2, 2>() * along);
    const double rate_error = last.yaw_rate_rad_s - truth.yaw_rate_rad_s;
    twist.add(speed_error * speed_error / speed_variance + rate_error * rate_error / last.twist_covariance(2, 2), 2);
  }
  EXPECT_TRUE(pose.is_consistent());
  EXPECT_TRUE(twist.is_consistent());
}

// --- all ------------------------------------------------------------------------------------------------------------

TEST(StandingError, IsOneThatStaysAndOneOfEachReading) {
  constexpr double kSigma = 0.3, kTruth = 7.0;
  constexpr int kSensors = 2000;
  double total = 0.0, of_readings = 0.0;  // squares
  for (int seed = 0; seed < kSensors; ++seed) {
    StandingError sensor(kSigma, static_cast<std::uint64_t>(seed));
    const double first = sensor.reading_of(kTruth), second = sensor.reading_of(kTruth);
    total += (first - kTruth) * (first - kTruth);
    of_readings += (first - second) * (first - second);
  }
  EXPECT_NEAR(total / kSensors, 2.0 * kSigma * kSigma, 0.02);        // 5 sigma of this mean
  EXPECT_NEAR(of_readings / kSensors, 2.0 * kSigma * kSigma, 0.02);  // so that one error was common to both
  EXPECT_DOUBLE_EQ(StandingError(kSigma, 1).variance(10.0), 11.0 * kSigma * kSigma);
  EXPECT_EQ(StandingError(0.0, 1).reading_of(kTruth), kTruth);
}

TEST(MotionSensors, AreThoseOfTheFileAndRefuseBadParams) {
  const WorldFile file(
      world_text("<body name=\"robot\" mocap=\"true\"><site name=\"imu\"/><site name=\"antenna\" pos=\"0 0 "
                 "0.2\"/><site name=\"base\"/></body>",
                 R"(<text name="imu" data="imu rate_hz 100"/> <text name="antenna" data="gnss correlation_s 20"/>
         <text name="base" data="odometry"/>)"));
  const World world(file.path());
  const WorldSensors sensors = sensors_of(world);
  ASSERT_EQ(sensors.imus.size(), 1U);
  EXPECT_EQ(sensors.imus[0].params.rate_hz, 100.0);
  ASSERT_EQ(sensors.gnss_receivers.size(), 1U);
  EXPECT_EQ(sensors.gnss_receivers[0].name, "antenna");
  EXPECT_EQ(sensors.gnss_receivers[0].params.correlation_s, 20.0);
  EXPECT_EQ(sensors.gnss_receivers[0].T_robot_sensor.translation().z(), 0.2);
  ASSERT_EQ(sensors.odometries.size(), 1U);
  EXPECT_TRUE(sensors.scanners.empty());

  const Eigen::Isometry3d I = Eigen::Isometry3d::Identity();
  SimulatedImuParams imu;
  imu.rate_hz = 0.0;
  EXPECT_TRUE(names(refusal_of([&] { SimulatedImu(world, I, imu, 0); }), {"imu.rate_hz", "0", "1", "10000"}));
  SimulatedGnssParams gnss;
  gnss.correlation_s = -1.0;
  EXPECT_TRUE(
      names(refusal_of([&] { SimulatedGnss(world, I, gnss, 0); }), {"gnss.correlation_s", "-1", "0.001", "1e+06"}));
  SimulatedOdometryParams odometry;
  odometry.yaw_scale_sigma = 1.0;
  EXPECT_TRUE(names(refusal_of([&] { SimulatedOdometry(world, I, odometry, 0); }),
                    {"odometry.yaw_scale_sigma", "1", "0", "0.5"}));
}

TEST(MotionSensors, GiveTheSameWithTheSameSeedIndependentOfOthers) {
  World world(kWorlds + "demo.xml");
  SimulatedImu a(world, some_mount(), {}, 3), b(world, some_mount(), {}, 3);
  SimulatedGnss other(world, some_mount(), {}, 3);
  SimulatedScanner scanner(world, world.T_robot_lidar(), {}, 3);
  for (int i = 0; i < 50; ++i) {
    const ImuSample from_a = a.next();
    if (i % 10 == 0) other.next(), scanner.next();
    const ImuSample from_b = b.next();
    EXPECT_EQ(from_a.specific_force_imu_m_s2, from_b.specific_force_imu_m_s2);
    EXPECT_EQ(from_a.angular_velocity_imu_rad_s, from_b.angular_velocity_imu_rad_s);
  }
}

}  // namespace
}  // namespace situation_awareness::motion_sensors_test

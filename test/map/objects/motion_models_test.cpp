// SPDX-License-Identifier: BSD-3-Clause
#include "situation_awareness/map/objects/motion_models.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <functional>
#include <utility>

#include "situation_awareness/common/random.hpp"
#include "support/covariance.hpp"
#include "support/random_gaussian.hpp"

namespace situation_awareness::motion_models_test {
namespace {

using namespace object_state;

constexpr double kScanPeriod_s = 0.05;
constexpr double kSeen_m = 0.02;  // measurement noise, per axis
const Eigen::Matrix3d kRobotIsKnown = Eigen::Matrix3d::Zero();

MotionParams motion() {
  MotionParams params;
  params.moving = {0.4, 0.3, 0.0, 0.002, 0.002};
  params.standing = {0.0, 0.0, 0.002, 0.002, 0.002};
  params.start_rate_1_s = 0.005;
  params.stop_rate_1_s = 0.1;
  params.start_velocity_sigma = 1.0;
  params.start_angular_velocity_sigma = 0.3;
  return params;
}

Measurement seen_at(const Eigen::Vector2d& position, Random& random) {
  Measurement measurement;
  measurement.R = kSeen_m * kSeen_m * Matrix5d::Identity();
  measurement.z << position, 0.25, 0.05, 0.02;
  measurement.z += kSeen_m * normal_vector<5>(random);
  return measurement;
}

/// An object on a path, tracked scan by scan.
struct Follower {
  explicit Follower(std::function<Eigen::Vector2d(double)> position_at, std::uint64_t seed)
      : position_at(std::move(position_at)), random(seed) {
    estimate = start(map_measurement(seen_at(this->position_at(0.0), random), {}, kRobotIsKnown), params);
  }

  void step() {
    time_s += kScanPeriod_s;
    predict(estimate, kScanPeriod_s, params);
    const Measurement measurement = seen_at(position_at(time_s), random);
    update(estimate, {}, measurement, match(estimate, {}, measurement, kRobotIsKnown), kRobotIsKnown);
  }

  void follow_until(double until_s) {
    while (time_s < until_s - 1e-9) step();
  }

  std::function<Eigen::Vector2d(double)> position_at;
  MotionParams params = motion();
  Random random;
  MotionEstimate estimate;
  double time_s = 0.0;
};

TEST(MotionModels, AStandingObjectsVelocityGoesToZeroAndItsPositionConverges) {
  for (std::uint64_t seed = 1; seed <= 20; ++seed) {
    Follower follower([](double) { return Eigen::Vector2d(3.0, 1.0); }, seed);
    follower.follow_until(10.0);
    const ObjectEstimate estimate = combine(follower.estimate);
    EXPECT_LT(follower.estimate.p_moving, 0.1) << seed;
    EXPECT_LT(estimate.x.segment<2>(kVelocity).norm(), 0.01) << seed;
    EXPECT_LT(std::abs(estimate.x(kAngularVelocity)), 0.02) << seed;
    EXPECT_LT((estimate.x.head<2>() - Eigen::Vector2d(3.0, 1.0)).norm(), 0.5 * kSeen_m) << seed;
    EXPECT_LT(estimate.P(0, 0), 0.1 * kSeen_m * kSeen_m) << seed;
    EXPECT_LT(estimate.P(kShape, kShape), 0.1 * kSeen_m * kSeen_m) << seed;
  }
}

TEST(MotionModels, AMovingObjectIsClassifiedAsMovingWithTheRightVelocity) {
  double square_sum = 0.0;
  const int runs = 20;
  for (int seed = 1; seed <= runs; ++seed) {
    Follower follower([](double t) { return Eigen::Vector2d(3.0 + 0.8 * t, 1.0 - 0.4 * t); },
                      static_cast<std::uint64_t>(seed));
    follower.follow_until(4.0);
    const ObjectEstimate estimate = combine(follower.estimate);
    EXPECT_GT(follower.estimate.p_moving, 0.95) << seed;
    EXPECT_LT((estimate.x.head<2>() - follower.position_at(follower.time_s)).norm(), 2.0 * kSeen_m) << seed;
    square_sum += (estimate.x.segment<2>(kVelocity) - Eigen::Vector2d(0.8, -0.4)).squaredNorm();
  }
  EXPECT_LT(std::sqrt(square_sum / runs), 0.12);
}

TEST(MotionModels, DetectsTheStartOfAMotionWithinTenScans) {
  for (std::uint64_t seed = 1; seed <= 20; ++seed) {
    Follower follower([](double t) { return Eigen::Vector2d(3.0 + std::max(0.0, t - 5.0), 1.0); }, seed);
    follower.follow_until(5.0);
    ASSERT_LT(follower.estimate.p_moving, 0.5) << seed;
    follower.follow_until(5.0 + 10 * kScanPeriod_s);
    EXPECT_GT(follower.estimate.p_moving, 0.5) << seed;
    // Already then the estimate is at its position, not where it stood.
    EXPECT_LT((combine(follower.estimate).x.head<2>() - follower.position_at(follower.time_s)).norm(), 0.1) << seed;
  }
}

TEST(MotionModels, DetectsTheStopOfAMotionWithinTwoSeconds) {
  for (std::uint64_t seed = 1; seed <= 20; ++seed) {
    Follower follower([](double t) { return Eigen::Vector2d(std::min(3.0, t), 1.0); }, seed);
    follower.follow_until(3.0);
    ASSERT_GT(follower.estimate.p_moving, 0.5) << seed;
    follower.follow_until(5.0);
    EXPECT_LT(follower.estimate.p_moving, 0.5) << seed;
    EXPECT_LT(combine(follower.estimate).x.segment<2>(kVelocity).norm(), 0.1) << seed;
  }
}

MotionEstimate random_estimate(Random& random) {
  MotionEstimate estimate;
  estimate.standing.x << 3.0, 1.0, 0.0, 0.0, 0.0, 0.25, 0.05, 0.02;
  estimate.moving.x = estimate.standing.x + 0.1 * normal_vector<8>(random);
  estimate.standing.P = random_covariance<Matrix8d>(random, 0.03);
  estimate.standing.P.middleRows<3>(kVelocity).setZero();
  estimate.standing.P.middleCols<3>(kVelocity).setZero();
  estimate.moving.P = random_covariance<Matrix8d>(random, 0.05);
  estimate.p_moving = random.uniform(0.05, 0.95);
  return estimate;
}

TEST(MotionModels, CombineHasTheMomentsOfTheMixture) {
  Random random(1);
  for (int i = 0; i < 20; ++i) {
    const MotionEstimate estimate = random_estimate(random);
    const auto second_moment = [](const ObjectEstimate& e) -> Matrix8d { return e.P + e.x * e.x.transpose(); };
    const double p = estimate.p_moving;
    const Vector8d mean = (1.0 - p) * estimate.standing.x + p * estimate.moving.x;
    const Matrix8d covariance =
        (1.0 - p) * second_moment(estimate.standing) + p * second_moment(estimate.moving) - mean * mean.transpose();
    const ObjectEstimate combined = combine(estimate);
    EXPECT_LT((combined.x - mean).norm(), 1e-12);
    EXPECT_LT((combined.P - covariance).cwiseAbs().maxCoeff(), 1e-12);
  }
}

TEST(MotionModels, LikelihoodIsThatOfTheMixture) {
  Random random(2);
  for (int i = 0; i < 20; ++i) {
    const MotionEstimate estimate = random_estimate(random);
    const Measurement measurement = seen_at({3.1, 1.05}, random);
    const MotionMatch m = match(estimate, {}, measurement, kRobotIsKnown);
    const double p = estimate.p_moving;
    const double standing =
        (1.0 - p) * std::exp(match(estimate.standing, {}, measurement, kRobotIsKnown).log_likelihood);
    const double moving = p * std::exp(match(estimate.moving, {}, measurement, kRobotIsKnown).log_likelihood);
    EXPECT_NEAR(std::exp(m.log_likelihood), standing + moving, 1e-9 * (standing + moving));
    // Bayes' rule.
    MotionEstimate updated = estimate;
    update(updated, {}, measurement, m, kRobotIsKnown);
    EXPECT_NEAR(updated.p_moving, moving / (standing + moving), 1e-8);
  }
}

TEST(MotionModels, ALikelihoodThatOneMotionCannotExplainStaysFinite) {
  Random random(3);
  MotionEstimate estimate = random_estimate(random);
  for (const double p : {0.0, 1e-9, 1.0 - 1e-9, 1.0}) {
    estimate.p_moving = p;
    const Measurement measurement = seen_at({60.0, 1.0}, random);
    const MotionMatch m = match(estimate, {}, measurement, kRobotIsKnown);
    EXPECT_TRUE(std::isfinite(m.log_likelihood)) << p;
    MotionEstimate updated = estimate;
    update(updated, {}, measurement, m, kRobotIsKnown);
    EXPECT_GT(updated.p_moving, 0.0) << p;
    EXPECT_LT(updated.p_moving, 1.0) << p;
  }
}

TEST(MotionModels, UnseenForLongItsProbabilityIsTheStationaryOne) {
  Random random(4);
  const MotionParams params = motion();
  const double expected = params.start_rate_1_s / (params.start_rate_1_s + params.stop_rate_1_s);
  for (const double p : {0.01, 0.99}) {
    MotionEstimate in_scans = random_estimate(random);
    in_scans.p_moving = p;
    MotionEstimate at_once = in_scans;
    for (int i = 0; i < 4000; ++i) predict(in_scans, kScanPeriod_s, params);
    EXPECT_NEAR(in_scans.p_moving, expected, 0.002) << p;
    predict(at_once, 200.0, params);
    EXPECT_NEAR(at_once.p_moving, expected, 0.002) << p;
  }
}

TEST(MotionModels, ProbabilitiesDoNotDependOnTheSteps) {
  Random random(5);
  const MotionParams params = motion();
  for (const double dt_s : {0.05, 0.5, 5.0}) {
    MotionEstimate once = random_estimate(random);
    MotionEstimate twice = once;
    predict(once, dt_s, params);
    predict(twice, 0.5 * dt_s, params);
    predict(twice, 0.5 * dt_s, params);
    EXPECT_NEAR(once.p_moving, twice.p_moving, 1e-9) << dt_s;
    if (dt_s < 0.1) {
      const ObjectEstimate a = combine(once);
      const ObjectEstimate b = combine(twice);
      EXPECT_LT((a.x - b.x).norm(), 1e-3);
      EXPECT_LT((a.P - b.P).norm(), 0.02 * a.P.norm());
    }
  }
}

TEST(MotionModels, WithRatesOfZeroNothingStartsOrStops) {
  Random random(6);
  MotionParams params = motion();
  params.start_rate_1_s = params.stop_rate_1_s = 0.0;
  const MotionEstimate before = random_estimate(random);
  MotionEstimate after = before;
  predict(after, 2.0, params);
  EXPECT_EQ(after.p_moving, before.p_moving);
  ObjectEstimate moving = before.moving;
  predict(moving, 2.0, params.moving);
  EXPECT_LT((after.moving.P - moving.P).norm(), 1e-12);
  EXPECT_LT((after.moving.x - moving.x).norm(), 1e-12);
}

TEST(MotionModels, ANewElementMayStandOrMove) {
  Random random(7);
  const MotionParams params = motion();
  const ObjectEstimate mapped = map_measurement(seen_at({3.0, 0.0}, random), {}, kRobotIsKnown);
  const MotionEstimate estimate = start(mapped, params);
  EXPECT_EQ(estimate.p_moving, 0.5);
  EXPECT_EQ(estimate.standing.P.middleRows<3>(kVelocity).norm(), 0.0);
  EXPECT_EQ(estimate.moving.P(kVelocity, kVelocity), 1.0);
  EXPECT_NEAR(estimate.moving.P(kAngularVelocity, kAngularVelocity), 0.09, 1e-12);
  EXPECT_EQ(estimate.standing.x, mapped.x);
  EXPECT_EQ(estimate.moving.x, mapped.x);
}

TEST(MotionModels, CovariancesStayPositiveSemiDefinite) {
  Follower follower([](double t) { return Eigen::Vector2d(3.0 + std::sin(t), std::cos(0.7 * t)); }, 8);
  for (int i = 0; i < 5000; ++i) {
    follower.step();
    for (const Matrix8d& P : {follower.estimate.standing.P, follower.estimate.moving.P}) {
      ASSERT_EQ(P, P.transpose());
      ASSERT_GE(smallest_eigenvalue(P), -1e-14);
    }
  }
}

// The variance of a rotating object grows with the cube of time; its radii must keep their precision.
TEST(MotionModels, SeenAgainAfterAnyTimeItHasACovariance) {
  Random random(13);
  for (int i = 0; i < 2000; ++i) {
    const Measurement measurement = seen_at({3.0, 1.0}, random);
    MotionEstimate estimate = start(map_measurement(measurement, {}, kRobotIsKnown), motion());
    const double dt_s = std::pow(10.0, random.uniform(-2.0, 10.0));
    for (int scan = 0; scan < 3; ++scan) {
      predict(estimate, dt_s, motion());
      Object object;
      fill_object(combine(estimate), Matrix8d::Zero(), object);
      ASSERT_TRUE(is_covariance(object.covariance)) << dt_s << " s, before scan " << scan;

      const MotionMatch seen = match(estimate, {}, measurement, kRobotIsKnown);
      ASSERT_TRUE(std::isfinite(seen.log_likelihood)) << dt_s << " s, scan " << scan;
      update(estimate, {}, measurement, seen, kRobotIsKnown);
      fill_object(combine(estimate), Matrix8d::Zero(), object);
      ASSERT_TRUE(is_covariance(object.covariance)) << dt_s << " s, scan " << scan;
    }
  }
}

TEST(MotionModels, ProbabilitiesStayInRangeAtAnyRates) {
  for (const double start_rate_1_s : {0.0, 1e-3, 3.7, 100.0}) {
    for (const double stop_rate_1_s : {0.0, 1e-3, 3.7, 100.0}) {
      MotionParams params = motion();
      params.start_rate_1_s = start_rate_1_s;
      params.stop_rate_1_s = stop_rate_1_s;
      for (int i = 1; i < 1000; ++i) {
        MotionEstimate estimate = start(ObjectEstimate{Vector8d::Zero(), Matrix8d::Identity()}, params);
        estimate.p_moving = i / 1000.0;
        predict(estimate, 1000.0, params);
        ASSERT_GE(estimate.p_moving, 0.0) << start_rate_1_s << ' ' << stop_rate_1_s << ' ' << i;
        ASSERT_LE(estimate.p_moving, 1.0) << start_rate_1_s << ' ' << stop_rate_1_s << ' ' << i;
      }
    }
  }
}

// A mixture of shapes has a shape between them: no weight is outside [0, 1], also with rounding at very high rates.
TEST(MotionModels, AMixtureLiesBetweenTheTwo) {
  Random random(12);
  const auto rate_1_s = [&random] { return std::pow(10.0, random.uniform(-25.0, 2.0)); };
  for (int i = 0; i < 20000; ++i) {
    MotionParams params;
    params.start_rate_1_s = rate_1_s();
    params.stop_rate_1_s = rate_1_s();
    MotionEstimate estimate;
    estimate.standing.x.tail<3>() << 0.2, 0.0, 0.0;
    estimate.moving.x.tail<3>() << 0.3, 0.1, -0.1;
    estimate.p_moving = random.uniform() < 0.5 ? 1e-9 : 1.0 - 1e-9;
    const Eigen::Vector3d least = estimate.standing.x.tail<3>().cwiseMin(estimate.moving.x.tail<3>());
    const Eigen::Vector3d most = estimate.standing.x.tail<3>().cwiseMax(estimate.moving.x.tail<3>());
    predict(estimate, std::pow(10.0, random.uniform(-3.0, 9.0)), params);
    for (const Vector8d& x : {estimate.standing.x, estimate.moving.x}) {
      ASSERT_TRUE(((x.tail<3>() - least).array() >= -1e-12).all()) << x.tail<3>().transpose();
      ASSERT_TRUE(((most - x.tail<3>()).array() >= -1e-12).all()) << x.tail<3>().transpose();
    }
  }
}

}  // namespace
}  // namespace situation_awareness::motion_models_test

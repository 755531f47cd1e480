// SPDX-License-Identifier: BSD-3-Clause
// The error-state filter on the 15-state navigation manifold: a small inertial navigation problem with position fixes.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <cstdint>

#include <Eigen/Core>
#include <Eigen/Geometry>

#include "situation_awareness/common/random.hpp"
#include "situation_awareness/estimation/error_state_filter.hpp"
#include "situation_awareness/estimation/gating.hpp"
#include "situation_awareness/estimation/navigation_state.hpp"
#include "situation_awareness/geometry/lie_groups.hpp"
#include "support/consistency.hpp"
#include "support/covariance.hpp"
#include "support/manifold_jacobian.hpp"
#include "support/random_gaussian.hpp"

namespace situation_awareness::inertial_navigation_test {
namespace {

using namespace navigation_error;

using Vector6d = Eigen::Matrix<double, 6, 1>;
using Matrix15d = ErrorMatrix<NavigationState>;
using Matrix315d = Eigen::Matrix<double, 3, 15>;

const Eigen::Vector3d kGravity_m_s2(0.0, 0.0, -9.81);

/// (specific force in m/s^2, angular rate in rad/s), in the frame of the IMU.
using Imu = Vector6d;

struct ImuNoise {
  double accelerometer = 0.02;        // m/s^2/sqrt(Hz)
  double gyroscope = 0.002;           // rad/s/sqrt(Hz)
  double accelerometer_bias = 0.002;  // m/s^2/sqrt(s), a random walk
  double gyroscope_bias = 0.0002;     // rad/s/sqrt(s)
};

// f(x): specific force and angular rate are constant over the step.
NavigationState strapdown(const NavigationState& x, const Imu& imu, double dt_s, const Eigen::Vector3d& gravity_m_s2) {
  const Eigen::Vector3d force = imu.head<3>() - x.accelerometer_bias_m_s2;
  const Eigen::Vector3d rate = imu.tail<3>() - x.gyroscope_bias_rad_s;
  const Eigen::Vector3d acceleration = x.q_world_imu * force + gravity_m_s2;
  NavigationState y = x;
  y.position_world_m += dt_s * x.velocity_world_m_s + 0.5 * dt_s * dt_s * acceleration;
  y.velocity_world_m_s += dt_s * acceleration;
  y.q_world_imu = (x.q_world_imu * exp_so3(dt_s * rate)).normalized();
  return y;
}

// F: an error of the attitude rotates the specific force, an error of a bias is subtracted.
Matrix15d strapdown_jacobian(const NavigationState& x, const Imu& imu, double dt_s) {
  const Eigen::Vector3d force = imu.head<3>() - x.accelerometer_bias_m_s2;
  const Eigen::Vector3d turn = dt_s * (imu.tail<3>() - x.gyroscope_bias_rad_s);
  const Eigen::Matrix3d R = x.q_world_imu.toRotationMatrix();
  const Eigen::Matrix3d a_by_attitude = -R * hat(force);
  Matrix15d F = Matrix15d::Identity();
  F.block<3, 3>(kPosition, kVelocity) = dt_s * Eigen::Matrix3d::Identity();
  F.block<3, 3>(kPosition, kAttitude) = 0.5 * dt_s * dt_s * a_by_attitude;
  F.block<3, 3>(kPosition, kAccelerometerBias) = -0.5 * dt_s * dt_s * R;
  F.block<3, 3>(kVelocity, kAttitude) = dt_s * a_by_attitude;
  F.block<3, 3>(kVelocity, kAccelerometerBias) = -dt_s * R;
  F.block<3, 3>(kAttitude, kAttitude) = exp_so3(-turn).toRotationMatrix();
  F.block<3, 3>(kAttitude, kGyroscopeBias) = -dt_s * right_jacobian_so3(turn);
  return F;
}

// d(f) / d(noise of the IMU): noise acts as a bias of this step only.
Eigen::Matrix<double, 15, 6> strapdown_noise_jacobian(const NavigationState& x, const Imu& imu, double dt_s) {
  Eigen::Matrix<double, 15, 6> L;
  L << strapdown_jacobian(x, imu, dt_s).middleCols<6>(kAccelerometerBias);
  L.bottomRows<6>().setZero();
  return L;
}

Matrix15d strapdown_covariance(const NavigationState& x, const Imu& imu, double dt_s, const ImuNoise& noise) {
  const Eigen::Matrix<double, 15, 6> L = strapdown_noise_jacobian(x, imu, dt_s);
  Vector6d variance;
  variance << Eigen::Vector3d::Constant(noise.accelerometer * noise.accelerometer / dt_s),
      Eigen::Vector3d::Constant(noise.gyroscope * noise.gyroscope / dt_s);
  Matrix15d Q = L * variance.asDiagonal() * L.transpose();
  Q.diagonal().segment<3>(kAccelerometerBias).array() += noise.accelerometer_bias * noise.accelerometer_bias * dt_s;
  Q.diagonal().segment<3>(kGyroscopeBias).array() += noise.gyroscope_bias * noise.gyroscope_bias * dt_s;
  return Q;
}

// h(x): a fix is the position.
Matrix315d fix_jacobian() {
  Matrix315d H = Matrix315d::Zero();
  H.block<3, 3>(0, kPosition).setIdentity();
  return H;
}

NavigationState random_state(Random& random) {
  return Manifold<NavigationState>::retract({}, normal_vector<15>(random));
}

/// A motion of the world, gravity with it.
struct WorldMotion {
  Eigen::Quaterniond turn = Eigen::Quaterniond::Identity();
  Eigen::Vector3d shift_m = Eigen::Vector3d::Zero();

  NavigationState operator*(const NavigationState& x) const {
    NavigationState result = x;
    result.position_world_m = turn * x.position_world_m + shift_m;
    result.velocity_world_m_s = turn * x.velocity_world_m_s;
    result.q_world_imu = turn * x.q_world_imu;
    return result;
  }

  /// Of the errors.
  Matrix15d jacobian() const {
    Matrix15d J = Matrix15d::Identity();
    J.block<3, 3>(kPosition, kPosition) = J.block<3, 3>(kVelocity, kVelocity) = turn.toRotationMatrix();
    return J;
  }
};

/// A run whose truth, IMU and fixes are drawn from the filter's own models: turns and climbs at 50 Hz, a fix with a
/// standard deviation of 0.5 m every 0.2 s.
struct NavigationRun {
  static constexpr double kStep_s = 0.02;
  static constexpr int kStepsPerFix = 10;

  explicit NavigationRun(std::uint64_t seed, const WorldMotion& motion_of_world = {})
      : motion(motion_of_world), random(seed) {
    Vector15d sigma;
    sigma << 0.5, 0.5, 0.5, 0.3, 0.3, 0.3, 0.03, 0.03, 0.1, 0.1, 0.1, 0.1, 0.01, 0.01, 0.01;
    estimate.P = sigma.cwiseAbs2().asDiagonal();
    estimate.x.velocity_world_m_s = {2.0, 0.0, 0.0};
    truth = Manifold<NavigationState>::retract(estimate.x, draw(estimate.P, random));
    truth = motion * truth;
    estimate.x = motion * estimate.x;
    estimate.P = motion.jacobian() * estimate.P * motion.jacobian().transpose();
    R = 0.25 * Eigen::Matrix3d::Identity();
  }

  void step() {
    const double t = kStep_s * ++steps;
    const Eigen::Vector3d gravity = motion.turn * kGravity_m_s2;
    const Eigen::Vector3d acceleration(2.0 * std::cos(0.8 * t), 1.5 * std::sin(0.6 * t), 0.5 * std::sin(t));
    Imu truly_felt;
    truly_felt << truth.q_world_imu.conjugate() * (motion.turn * acceleration - gravity), 0.3 * std::sin(t),
        0.2 * std::cos(0.7 * t), 0.4;
    truly_felt.head<3>() += truth.accelerometer_bias_m_s2;
    truly_felt.tail<3>() += truth.gyroscope_bias_rad_s;
    Imu imu = truly_felt;
    imu.head<3>() += noise.accelerometer / std::sqrt(kStep_s) * normal_vector<3>(random);
    imu.tail<3>() += noise.gyroscope / std::sqrt(kStep_s) * normal_vector<3>(random);
    truth = strapdown(truth, truly_felt, kStep_s, gravity);
    truth.accelerometer_bias_m_s2 += noise.accelerometer_bias * std::sqrt(kStep_s) * normal_vector<3>(random);
    truth.gyroscope_bias_rad_s += noise.gyroscope_bias * std::sqrt(kStep_s) * normal_vector<3>(random);

    const Matrix15d F = strapdown_jacobian(estimate.x, imu, kStep_s);
    const Matrix15d Q = strapdown_covariance(estimate.x, imu, kStep_s, noise);
    predict(estimate, strapdown(estimate.x, imu, kStep_s, gravity), F, Q);

    if (steps % kStepsPerFix != 0) return;
    const Eigen::Vector3d fix_m = truth.position_world_m + motion.turn * draw(R, random);
    const Matrix315d H = fix_jacobian();
    const Eigen::Vector3d nu = fix_m - estimate.x.position_world_m;
    const Innovation<3> compared = innovation(estimate, nu, H, R);
    nis = compared.mahalanobis2;
    update(estimate, compared, H, R);
  }

  using Vector15d = ErrorVector<NavigationState>;
  WorldMotion motion;
  Random random;
  ImuNoise noise;
  NavigationState truth;
  Estimate<NavigationState> estimate;
  Eigen::Matrix3d R;
  double nis = 0.0;
  int steps = 0;
};

TEST(InertialNavigation, JacobiansEqualNumericalOnes) {
  Random random(1);
  for (int i = 0; i < 20; ++i) {
    const NavigationState x = random_state(random);
    const Imu imu = 3.0 * normal_vector<6>(random);
    const double dt_s = random.uniform(0.002, 0.2);
    const auto F = manifold_jacobian<NavigationState>(
        [&](const NavigationState& at) { return strapdown(at, imu, dt_s, kGravity_m_s2); }, x);
    EXPECT_LT((F - strapdown_jacobian(x, imu, dt_s)).cwiseAbs().maxCoeff(), 1e-7);

    const auto L = manifold_jacobian<NavigationState>(
        [&](const Vector6d& noise) { return strapdown(x, imu - noise, dt_s, kGravity_m_s2); },
        Vector6d(Vector6d::Zero()));
    EXPECT_LT((L - strapdown_noise_jacobian(x, imu, dt_s)).cwiseAbs().maxCoeff(), 1e-7);

    const auto H = manifold_jacobian<Eigen::Vector3d>([](const NavigationState& at) { return at.position_world_m; }, x);
    EXPECT_LT((H - fix_jacobian()).cwiseAbs().maxCoeff(), 1e-8);
  }
}

TEST(InertialNavigationStatistics, NeesAndNisOfSeededRunsAreInsideTheirBands) {
  for (const int steps : {50, 250, 1000}) {
    ChiSquareSum nees_sum;
    ChiSquareSum nis_sum;
    for (int k = 0; k < 30; ++k) {
      NavigationRun run(static_cast<std::uint64_t>(1000 * steps + k));
      for (int i = 0; i < steps; ++i) run.step();
      nees_sum.add(nees(run.estimate, run.truth), 15);
      nis_sum.add(run.nis, 3);
    }
    EXPECT_TRUE(nees_sum.is_consistent()) << "NEES, " << steps << " steps";
    EXPECT_TRUE(nis_sum.is_consistent()) << "NIS, " << steps << " steps";
  }
}

TEST(InertialNavigation, ManoeuvresMakeAttitudeAndBiasesObservable) {
  NavigationRun run(1);
  const ErrorVector<NavigationState> before = run.estimate.P.diagonal().cwiseSqrt();
  for (int i = 0; i < 1500; ++i) run.step();
  const ErrorVector<NavigationState> after = run.estimate.P.diagonal().cwiseSqrt();
  EXPECT_LT((after.array() / before.array()).maxCoeff(), 0.5) << (after.array() / before.array()).transpose();
}

// With gravity rotated as well. The errors of position and velocity are in the world frame and rotate with it.
TEST(InertialNavigation, RigidMotionOfTheWorldMovesTheEstimateWithIt) {
  Random random(2);
  for (std::uint64_t k = 0; k < 5; ++k) {
    const WorldMotion motion{exp_so3(normal_vector<3>(random)), 10.0 * normal_vector<3>(random)};
    NavigationRun here(k);
    NavigationRun there(k, motion);
    for (int i = 0; i < 200; ++i) {
      here.step();
      there.step();
      EXPECT_NEAR(here.nis, there.nis, 1e-7);
    }
    EXPECT_LT(Manifold<NavigationState>::local_coordinates(motion * here.estimate.x, there.estimate.x).norm(), 1e-8);
    const Matrix15d expected = motion.jacobian() * here.estimate.P * motion.jacobian().transpose();
    EXPECT_LT((there.estimate.P - expected).cwiseAbs().maxCoeff(), 1e-9);
  }
}

TEST(InertialNavigationStatistics, CovarianceStaysSymmetricPositiveDefiniteOverAHundredThousandSteps) {
  NavigationRun run(42);
  double least = 1e9;
  for (int i = 0; i < 100000; ++i) {
    run.step();
    const Matrix15d& P = run.estimate.P;
    ASSERT_EQ(P, P.transpose()) << "step " << i;
    if (i % 100 != 0) continue;
    // Of correlations: units and magnitudes do not matter.
    const ErrorVector<NavigationState> weight = P.diagonal().cwiseSqrt().cwiseInverse();
    const Matrix15d correlations = weight.asDiagonal() * P * weight.asDiagonal();
    least = std::min(least, smallest_eigenvalue(correlations));
  }
  EXPECT_GT(least, 1e-9);  // far above rounding
  EXPECT_LT(nees(run.estimate, run.truth), chi_square_quantile(0.9999, 15));
  EXPECT_NEAR(run.estimate.x.q_world_imu.norm(), 1.0, 1e-15);
}

}  // namespace
}  // namespace situation_awareness::inertial_navigation_test

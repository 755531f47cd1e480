// SPDX-License-Identifier: BSD-3-Clause
#include "situation_awareness/map/objects/object_filter.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <utility>

#include <Eigen/LU>

#include "situation_awareness/common/random.hpp"
#include "situation_awareness/estimation/gating.hpp"
#include "situation_awareness/geometry/angles.hpp"
#include "support/covariance.hpp"
#include "support/numerical_jacobian.hpp"
#include "support/random_gaussian.hpp"

namespace situation_awareness::object_filter_test {
namespace {

using namespace object_state;

constexpr int kAxis = kShape + 1;  // (p, q)
const ProcessNoise kNoise{0.2, 0.1, 0.01, 0.002, 0.002};

Vector8d state_of(const Ellipse& ellipse, const Eigen::Vector2d& velocity = Eigen::Vector2d::Zero(), double w = 0.0) {
  const Vector5d smooth = smooth_parameters(ellipse);
  Vector8d x;
  x << smooth.head<2>(), velocity, w, smooth.tail<3>();
  return x;
}

Vector8d random_state(Random& random) {
  return state_of({{random.uniform(-5.0, 5.0), random.uniform(-5.0, 5.0)},
                   random.uniform(-kPi, kPi),
                   random.uniform(0.35, 0.5),
                   random.uniform(0.1, 0.3)},
                  {random.normal(), random.normal()}, random.normal());
}

Pose2 random_pose(Random& random) {
  return {{random.uniform(-5.0, 5.0), random.uniform(-5.0, 5.0)}, random.uniform(-kPi, kPi)};
}

Eigen::Vector3d vector_of(const Pose2& T) { return {T.translation_m.x(), T.translation_m.y(), T.yaw_rad}; }
Pose2 pose_of(const Eigen::Vector3d& u) { return {u.head<2>(), u(2)}; }

Measurement random_measurement(const Vector8d& x, const Pose2& T_world_level, Random& random) {
  Measurement measurement;
  measurement.time_offset_s = random.uniform(0.0, 0.05);
  measurement.R = random_covariance<Matrix5d>(random, 0.02);
  measurement.z = measure(x, T_world_level, measurement.time_offset_s) + draw(measurement.R, random);
  return measurement;
}

/// The same up to rounding.
template <class A, class B>
void expect_close(const A& a, const B& b) {
  EXPECT_LE((a - b).cwiseAbs().maxCoeff(), 1e-13 * (1.0 + b.cwiseAbs().maxCoeff()));
}

TEST(ObjectFilter, ItsProductsWithoutZerosAreTheFullOnes) {
  Random random(12);
  for (int i = 0; i < 200; ++i) {
    ObjectEstimate estimate{random_state(random), random_covariance<Matrix8d>(random, 0.1)};
    if (i % 2 == 0) {  // as of what stands
      estimate.x.segment<3>(kVelocity).setZero();
      estimate.P.middleRows<3>(kVelocity).setZero();
      estimate.P.middleCols<3>(kVelocity).setZero();
    }
    const Pose2 T_world_level = random_pose(random);
    const Eigen::Matrix3d U = random_covariance<Eigen::Matrix3d>(random, 0.01);
    for (const Course course : {Course::kStraight, Course::kTurning}) {
      ObjectEstimate predicted = estimate;
      predict(predicted, 0.1, kNoise, course);
      ObjectEstimate full = estimate;
      predict(full, predict(estimate.x, 0.1, course), process_jacobian(estimate.x, 0.1, course),
              process_covariance(estimate.x, 0.1, kNoise));
      expect_close(predicted.x, full.x);
      expect_close(predicted.P, full.P);
    }
    const Measurement measurement = random_measurement(estimate.x, T_world_level, random);
    const Match m = match(estimate, T_world_level, measurement, U);
    const Matrix58d H = measurement_jacobian(T_world_level, measurement.time_offset_s);
    const Matrix53d H_u = measurement_input_jacobian(estimate.x, T_world_level, measurement.time_offset_s);
    const Matrix5d R = measurement.R + H_u * U * H_u.transpose();
    const Match full = innovation(estimate, m.nu, H, R);
    expect_close(m.S, full.S);
    EXPECT_NEAR(m.log_likelihood, full.log_likelihood, 1e-11 * (1.0 + std::abs(full.log_likelihood)));
    ObjectEstimate corrected = estimate;
    update(corrected, T_world_level, measurement, m, U);
    ObjectEstimate by_full = estimate;
    update(by_full, full, H, R);
    expect_close(corrected.x, by_full.x);
    expect_close(corrected.P, by_full.P);
    const Matrix58d H_now = measurement_jacobian(T_world_level, 0.0);
    expect_close(state_covariance(measurement.R, T_world_level), Matrix8d(H_now.transpose() * measurement.R * H_now));
  }
}

TEST(ObjectFilter, JacobiansEqualNumericalOnes) {
  Random random(2);
  for (int i = 0; i < 50; ++i) {
    const Vector8d x = random_state(random);
    const Pose2 T = random_pose(random);
    const double dt_s = random.uniform(0.0, 2.0);
    const double offset_s = random.uniform(-0.1, 0.1);

    for (const Course course : {Course::kStraight, Course::kTurning}) {
      const auto F = numerical_jacobian<8, 8>([&](const Vector8d& at) { return predict(at, dt_s, course); }, x);
      EXPECT_LT((F - process_jacobian(x, dt_s, course)).cwiseAbs().maxCoeff(), 1e-8);
    }

    const auto H = numerical_jacobian<5, 8>([&](const Vector8d& at) { return measure(at, T, offset_s); }, x);
    EXPECT_LT((H - measurement_jacobian(T, offset_s)).cwiseAbs().maxCoeff(), 1e-8);

    const auto H_u = numerical_jacobian<5, 3>(
        [&](const Eigen::Vector3d& u) { return measure(x, pose_of(u), offset_s); }, vector_of(T));
    EXPECT_LT((H_u - measurement_input_jacobian(x, T, offset_s)).cwiseAbs().maxCoeff(), 1e-8) << offset_s << " s";
  }
}

TEST(ObjectFilter, MappingIsTheInverseOfMeasuring) {
  Random random(3);
  for (int i = 0; i < 50; ++i) {
    const Vector8d x = random_state(random);
    const Pose2 T = random_pose(random);
    Measurement measurement;
    measurement.z = measure(x, T, 0.0);
    Vector8d at_rest = x;
    at_rest.segment<3>(kVelocity).setZero();
    EXPECT_LT((map_measurement(measurement, T, Eigen::Matrix3d::Zero()).x - at_rest).norm(), 1e-9);
  }
}

TEST(ObjectFilter, MappingTransformsTheCovariancesOfMeasurementAndRobot) {
  Random random(4);
  for (int i = 0; i < 50; ++i) {
    const Pose2 T = random_pose(random);
    Measurement measurement = random_measurement(random_state(random), T, random);
    measurement.time_offset_s = 0.0;
    const auto U = random_covariance<Eigen::Matrix3d>(random, 0.01);
    const auto mapped = [](const Vector5d& z, const Pose2& at) {
      Measurement exact;
      exact.z = z;
      exact.R.setZero();
      return map_measurement(exact, at, Eigen::Matrix3d::Zero()).x;
    };
    const auto G = numerical_jacobian<8, 5>([&](const Vector5d& z) { return mapped(z, T); }, measurement.z);
    const auto G_u = numerical_jacobian<8, 3>(
        [&](const Eigen::Vector3d& u) { return mapped(measurement.z, pose_of(u)); }, vector_of(T));
    const Matrix8d expected = G * measurement.R * G.transpose() + G_u * U * G_u.transpose();
    EXPECT_LT((map_measurement(measurement, T, U).P - expected).cwiseAbs().maxCoeff(), 1e-8);
  }
}

TEST(ObjectFilter, OneLongStepPredictsAsManyShortOnes) {
  Random random(5);
  for (const double w : {0.0, 0.7}) {
    ObjectEstimate whole;
    whole.x = random_state(random);
    whole.x(kAngularVelocity) = w;
    whole.P = random_covariance<Matrix8d>(random, 0.3);
    ObjectEstimate in_steps = whole;
    const int steps = 64;
    for (int i = 0; i < steps; ++i) predict(in_steps, 1.6 / steps, {0.7, 0.4, 0.1, 0.02, 0.03});
    predict(whole, 1.6, {0.7, 0.4, 0.1, 0.02, 0.03});
    EXPECT_LT((in_steps.x - whole.x).norm(), 1e-9) << w;
    EXPECT_LT((in_steps.P - whole.P).cwiseAbs().maxCoeff(), 1e-9) << w;
  }
}

TEST(ObjectFilter, AVelocityThatTurnsGoesAroundACircle) {
  Random random(7);
  for (const double w : {-1.3, -1e-9, 1e-9, 2e-4, 0.02, 0.9}) {
    Vector8d x = random_state(random);
    x(kAngularVelocity) = w;
    const Vector8d after = predict(x, 0.7, Course::kTurning);
    EXPECT_NEAR(after.segment<2>(kVelocity).norm(), x.segment<2>(kVelocity).norm(), 1e-12);
    Vector8d in_steps = x;
    for (int i = 0; i < 32; ++i) in_steps = predict(in_steps, 0.7 / 32, Course::kTurning);
    EXPECT_LT((in_steps - after).norm(), 1e-9) << w;
    if (std::abs(w) < 1e-6) {
      EXPECT_LT((predict(x, 0.7) - after).norm(), 1e-8);
    } else {
      const Vector8d around = predict(x, 2.0 * kPi / std::abs(w), Course::kTurning);
      EXPECT_LT((around - x).norm(), 1e-7) << w;
    }
  }
}

TEST(ObjectFilter, TheJacobianOfATurnHasNoStepAtItsSeries) {
  Random random(8);
  Vector8d x = random_state(random);
  for (const double w : {0.999e-3, 1.001e-3}) {
    x(kAngularVelocity) = w;
    const auto F = numerical_jacobian<8, 8>([&](const Vector8d& at) { return predict(at, 1.0, Course::kTurning); }, x);
    EXPECT_LT((F - process_jacobian(x, 1.0, Course::kTurning)).cwiseAbs().maxCoeff(), 1e-6) << w;
  }
}

// An oracle for Q that integrates nothing by formula: very many tiny steps with independent kicks.
TEST(ObjectFilter, ProcessNoiseIsThatOfManySmallAccelerations) {
  Random random(6);
  const Vector8d x = random_state(random);
  const double dt_s = 0.8;
  const int steps = 2000;
  const double h_s = dt_s / steps;
  const ProcessNoise noise{0.7, 0.4, 0.1, 0.02, 0.03};
  Vector8d kick;
  kick << noise.position, noise.position, noise.acceleration, noise.acceleration, noise.angular_acceleration,
      noise.mean_radius, noise.radius_difference, noise.radius_difference;
  Matrix8d sum = Matrix8d::Zero();
  for (int i = 0; i < steps; ++i) {
    const double remaining_s = dt_s - (i + 0.5) * h_s;
    const Matrix8d F = process_jacobian(predict(x, dt_s - remaining_s), remaining_s);
    sum += F * (h_s * kick.cwiseAbs2()).asDiagonal() * F.transpose();
  }
  EXPECT_LT((sum - process_covariance(x, dt_s, noise)).cwiseAbs().maxCoeff(), 1e-6);
}

TEST(ObjectFilter, RigidMotionOfTheWorldMovesTheEstimateWithIt) {
  Random random(7);
  for (int i = 0; i < 50; ++i) {
    const Pose2 motion = random_pose(random);
    const Pose2 T = random_pose(random);
    Matrix8d turn = Matrix8d::Identity();
    turn.block<2, 2>(kPosition, kPosition) = turn.block<2, 2>(kVelocity, kVelocity) = motion.rotation();
    turn.block<2, 2>(kAxis, kAxis) = Eigen::Rotation2Dd(2.0 * motion.yaw_rad).toRotationMatrix();
    Eigen::Matrix3d turn_u = Eigen::Matrix3d::Identity();
    turn_u.topLeftCorner<2, 2>() = motion.rotation();
    const auto moved = [&](const ObjectEstimate& estimate) {
      ObjectEstimate result{turn * estimate.x, turn * estimate.P * turn.transpose()};
      result.x.segment<2>(kPosition) += motion.translation_m;
      return result;
    };

    ObjectEstimate a{random_state(random), random_covariance<Matrix8d>(random, 0.05)};
    ObjectEstimate b = moved(a);
    const auto U = random_covariance<Eigen::Matrix3d>(random, 0.01);
    const Eigen::Matrix3d U_b = turn_u * U * turn_u.transpose();
    const Measurement measurement = random_measurement(a.x, T, random);
    predict(a, 0.3, kNoise);
    predict(b, 0.3, kNoise);
    const Match match_a = match(a, T, measurement, U);
    const Match match_b = match(b, motion * T, measurement, U_b);
    EXPECT_NEAR(match_a.log_likelihood, match_b.log_likelihood, 1e-7);
    update(a, T, measurement, match_a, U);
    update(b, motion * T, measurement, match_b, U_b);
    EXPECT_LT((b.x - moved(a).x).norm(), 1e-9);
    EXPECT_LT((b.P - moved(a).P).cwiseAbs().maxCoeff(), 1e-9);
    // And the ellipse moves as a curve.
    EXPECT_LT((shape_matrix(ellipse_world(b.x)) - shape_matrix(motion * ellipse_world(a.x))).norm(), 1e-9);
  }
}

// Sect. V-C of the ellipse paper, and its extension to swapped radii: whichever way a detection describes the curve, it
// is the same measurement.
TEST(ObjectFilter, TheDescriptionOfTheMeasuredCurveDoesNotMatter) {
  Random random(8);
  for (int i = 0; i < 50; ++i) {
    Detection detection;
    detection.ellipse_level = ellipse_world(random_state(random));
    detection.covariance = random_covariance<Matrix5d>(random, 0.02);
    const Measurement expected = measurement_of(detection);
    detection.ellipse_level.psi_rad += kPi;
    const Measurement turned = measurement_of(detection);
    detection.ellipse_level.psi_rad += kPi / 2.0;
    std::swap(detection.ellipse_level.rx_m, detection.ellipse_level.ry_m);
    const Measurement swapped = measurement_of(detection);
    EXPECT_LT((turned.z - expected.z).norm(), 1e-9);
    EXPECT_LT((swapped.z - expected.z).norm(), 1e-9);
    EXPECT_LT((swapped.R - expected.R).norm(), 1e-9);
  }
}

// R without the velocities: the state's covariance transformed back to the level frame.
TEST(ObjectFilter, StateCovarianceIsThatOfTheMeasurement) {
  Random random(9);
  for (int i = 0; i < 50; ++i) {
    const Pose2 T = random_pose(random);
    const auto R = random_covariance<Matrix5d>(random, 0.02);
    const Matrix8d P = state_covariance(R, T);
    const auto H =
        numerical_jacobian<5, 8>([&](const Vector8d& x) { return measure(x, T, 0.0); }, random_state(random));
    EXPECT_LT((H * P * H.transpose() - R).cwiseAbs().maxCoeff(), 1e-9);
    EXPECT_EQ(P.middleRows<3>(kVelocity).norm(), 0.0);
    EXPECT_EQ(P.middleCols<3>(kVelocity).norm(), 0.0);
  }
}

TEST(ObjectFilter, UpdateEqualsTheInformationForm) {
  Random random(12);
  for (int i = 0; i < 20; ++i) {
    const Pose2 T = random_pose(random);
    const ObjectEstimate before{random_state(random), random_covariance<Matrix8d>(random, 0.05)};
    const auto U = random_covariance<Eigen::Matrix3d>(random, 0.01);
    const Measurement measurement = random_measurement(before.x, T, random);
    ObjectEstimate after = before;
    const Match m = match(before, T, measurement, U);
    update(after, T, measurement, m, U);
    const Matrix58d H = measurement_jacobian(T, measurement.time_offset_s);
    const Matrix53d H_u = measurement_input_jacobian(before.x, T, measurement.time_offset_s);
    const Matrix5d R_inverse = (measurement.R + H_u * U * H_u.transpose()).inverse();
    const Matrix8d P = (before.P.inverse() + H.transpose() * R_inverse * H).inverse();
    EXPECT_LT((after.P - P).cwiseAbs().maxCoeff(), 1e-9);
    EXPECT_LT((after.x - before.x - P * H.transpose() * R_inverse * m.nu).norm(), 1e-8);
    // And the likelihood is the normal density of the innovation.
    const double log_density = -0.5 * (m.nu.dot(m.S.inverse() * m.nu) + std::log((2.0 * kPi * m.S).determinant()));
    EXPECT_NEAR(m.log_likelihood, log_density, 1e-8);
  }
}

/// A matched simulation: truth, process, robot pose and measurements drawn from the filter's own models.
struct MatchedRun {
  explicit MatchedRun(std::uint64_t seed) : random(seed) {
    truth = random_state(random);
    truth.segment<2>(kVelocity) *= 0.3;
    truth(kAngularVelocity) *= 0.1;
    truth.tail<3>() = smooth_parameters({{0.0, 0.0}, random.uniform(-kPi, kPi), 0.55, 0.2}).tail<3>();
    R = (Vector5d() << 0.02, 0.02, 0.02, 0.015, 0.015).finished().cwiseAbs2().asDiagonal();
    U = Eigen::Vector3d(0.01, 0.01, 0.002).cwiseAbs2().asDiagonal();
    estimate.P = (Vector8d() << 0.05, 0.05, 0.3, 0.3, 0.1, 0.03, 0.02, 0.02).finished().cwiseAbs2().asDiagonal();
    estimate.x = truth + draw(estimate.P, random);
  }

  void step() {
    const double dt_s = random.uniform(0.02, 0.1);
    const Matrix8d Q = process_covariance(truth, dt_s, kNoise);
    truth = predict(truth, dt_s) + draw(Q, random);
    predict(estimate, dt_s, kNoise);

    // The robot circles the object; the filter gets a noisy pose.
    angle_rad += 0.02;
    const Pose2 T_true{truth.head<2>() - 3.0 * Eigen::Vector2d(std::cos(angle_rad), std::sin(angle_rad)), angle_rad};
    const Pose2 T_given = pose_of(vector_of(T_true) + draw(U, random));
    Measurement measurement;
    measurement.R = R;
    measurement.time_offset_s = random.uniform(0.0, 0.02);
    measurement.z = measure(truth, T_true, measurement.time_offset_s) + draw(R, random);
    const Match m = match(estimate, T_given, measurement, U);
    nis = m.mahalanobis2;
    update(estimate, T_given, measurement, m, U);
  }

  double nees() const { return mahalanobis2(truth - estimate.x, estimate.P); }

  /// Of the published estimate.
  double published_nees() const {
    Object object;
    fill_object(estimate, Matrix8d::Zero(), object);
    const Ellipse true_ellipse = ellipse_world(truth);
    Vector8d error;
    error << true_ellipse.center_m - object.ellipse_world.center_m,
        truth.segment<2>(kVelocity) - object.velocity_world_m_s,
        wrap_to_half_pi(true_ellipse.psi_rad - object.ellipse_world.psi_rad),
        truth(kAngularVelocity) - object.angular_velocity_rad_s, true_ellipse.rx_m - object.ellipse_world.rx_m,
        true_ellipse.ry_m - object.ellipse_world.ry_m;
    return mahalanobis2(error, object.covariance);
  }

  Random random;
  Vector8d truth;
  ObjectEstimate estimate;
  Matrix5d R;
  Eigen::Matrix3d U;
  double angle_rad = 0.0;
  double nis = 0.0;
};

TEST(ObjectFilter, NeesAndNisOfFiftySeededRunsAreInsideTheir95PercentBands) {
  const int runs = 50;
  for (const int steps : {5, 50, 200}) {
    double nees = 0.0;
    double published_nees = 0.0;
    double nis = 0.0;
    for (int run = 0; run < runs; ++run) {
      MatchedRun simulation(static_cast<std::uint64_t>(1000 * steps + run));
      for (int i = 0; i < steps; ++i) simulation.step();
      nees += simulation.nees();
      published_nees += simulation.published_nees();
      nis += simulation.nis;
    }
    // Sums over independent runs are chi-square distributed with as many degrees of freedom as they add up.
    EXPECT_GT(nees, chi_square_quantile(0.025, 8.0 * runs)) << steps << " steps";
    EXPECT_LT(nees, chi_square_quantile(0.975, 8.0 * runs)) << steps << " steps";
    EXPECT_GT(published_nees, chi_square_quantile(0.025, 8.0 * runs)) << steps << " steps";
    EXPECT_LT(published_nees, chi_square_quantile(0.975, 8.0 * runs)) << steps << " steps";
    EXPECT_GT(nis, chi_square_quantile(0.025, 5.0 * runs)) << steps << " steps";
    EXPECT_LT(nis, chi_square_quantile(0.975, 5.0 * runs)) << steps << " steps";
  }
}

TEST(ObjectFilter, CovarianceStaysSymmetricPositiveDefiniteOverAHundredThousandSteps) {
  MatchedRun simulation(42);
  double least = 1e9;
  double most_asymmetry = 0.0;
  for (int i = 0; i < 100000; ++i) {
    simulation.step();
    const Matrix8d& P = simulation.estimate.P;
    most_asymmetry = std::max(most_asymmetry, (P - P.transpose()).cwiseAbs().maxCoeff());
    if (i % 10 == 0) least = std::min(least, smallest_eigenvalue(P));
  }
  EXPECT_GT(least, 0.0);
  EXPECT_EQ(most_asymmetry, 0.0);
}

TEST(ObjectFilter, AnEllipseAcrossTheSeamOfPsiIsTrackedWithoutJumps) {
  for (const double psi_deg : {89.9, 90.0, -90.0, 0.0}) {
    Random random(13);
    const Ellipse truth{{3.0, 0.0}, radians(psi_deg), 0.4, 0.2};
    const Matrix5d R = 4e-4 * Matrix5d::Identity();
    ObjectEstimate estimate;
    for (int i = 0; i < 400; ++i) {
      Detection detection;
      detection.ellipse_level = canonical(ellipse_from_smooth_parameters(smooth_parameters(truth) + draw(R, random)));
      detection.covariance = R;
      const Measurement measurement = measurement_of(detection);
      if (i == 0) {
        estimate = map_measurement(measurement, {}, Eigen::Matrix3d::Zero());
        estimate.P.diagonal().segment<3>(kVelocity).setConstant(0.01);
      } else {
        predict(estimate, 0.05, {0.05, 0.05, 0.0, 1e-4, 1e-4});
        update(estimate, {}, measurement, match(estimate, {}, measurement, Eigen::Matrix3d::Zero()),
               Eigen::Matrix3d::Zero());
      }
      Object object;
      fill_object(estimate, Matrix8d::Zero(), object);
      const double error_rad = wrap_to_half_pi(object.ellipse_world.psi_rad - truth.psi_rad);
      const double sigma_rad = std::sqrt(object.covariance(object_error::kOrientation, object_error::kOrientation));
      EXPECT_LT(std::abs(error_rad), 4.0 * sigma_rad) << psi_deg << " deg, scan " << i;
      if (i > 100) {
        EXPECT_LT(degrees(std::abs(error_rad)), 5.0) << psi_deg << " deg, scan " << i;
      }
    }
  }
}

TEST(ObjectFilter, AnObjectSeenAfterTheStampIsNotBiased) {
  const Eigen::Vector2d velocity(1.2, -0.8);
  const Vector8d truth_at_0 = state_of({{2.0, 1.0}, 0.3, 0.3, 0.2}, velocity);
  const Pose2 T{{0.5, -0.5}, 0.7};
  ObjectEstimate estimate;
  for (int i = 0; i < 100; ++i) {
    const Vector8d truth = predict(truth_at_0, 0.05 * i);
    Measurement measurement;
    measurement.R = 1e-4 * Matrix5d::Identity();
    measurement.time_offset_s = 0.04;
    measurement.z = measure(predict(truth, measurement.time_offset_s), T, 0.0);
    if (i == 0) {
      estimate = map_measurement(measurement, T, Eigen::Matrix3d::Zero());
      estimate.P.diagonal().segment<3>(kVelocity).setConstant(4.0);
    } else {
      predict(estimate, 0.05, {0.1, 0.1, 0.0, 1e-3, 1e-3});
      update(estimate, T, measurement, match(estimate, T, measurement, Eigen::Matrix3d::Zero()),
             Eigen::Matrix3d::Zero());
    }
    if (i > 50) {
      EXPECT_LT((estimate.x - truth).head<2>().norm(), 1e-3) << i;  // it moves 58 mm in the meantime
    }
  }
}

TEST(FillObject, CovarianceIsTransformedByTheJacobian) {
  Random random(14);
  for (int i = 0; i < 50; ++i) {
    ObjectEstimate estimate{random_state(random), random_covariance<Matrix8d>(random, 0.002)};
    if (std::abs(ellipse_world(estimate.x).psi_rad) > 1.5) continue;  // numerical differences jump there
    Object object;
    fill_object(estimate, Matrix8d::Zero(), object);
    const auto J = numerical_jacobian<8, 8>(
        [](const Vector8d& x) {
          const Ellipse ellipse = ellipse_world(x);
          Vector8d y;
          y << ellipse.center_m, x.segment<2>(kVelocity), ellipse.psi_rad, x(kAngularVelocity), ellipse.rx_m,
              ellipse.ry_m;
          return y;
        },
        state_of(object.ellipse_world, object.velocity_world_m_s, object.angular_velocity_rad_s));
    EXPECT_LT((object.covariance - J * estimate.P * J.transpose()).cwiseAbs().maxCoeff(), 1e-8);
    EXPECT_EQ(object.covariance, object.covariance.transpose());
    EXPECT_GE(object.ellipse_world.rx_m, object.ellipse_world.ry_m);
  }
}

// Errors make (p, q) longer on average, whatever their direction: the difference of the radii must not grow by that. At
// a circle some remains, since no radii differ by less than nothing: half of what it would be.
TEST(FillObject, TheDifferenceOfTheRadiiIsNotBiasedByErrors) {
  Random random(20);
  const double sigma_m = 0.01;
  for (const double difference_m : {0.3, 0.1, 0.06, 0.0}) {
    const Vector8d truth = state_of({{3.0, 1.0}, 0.4, 0.25 + 0.5 * difference_m, 0.25 - 0.5 * difference_m});
    ObjectEstimate estimate;
    estimate.P.diagonal() << 1e-4, 1e-4, 0.0, 0.0, 0.0, 1e-4, sigma_m * sigma_m, sigma_m * sigma_m;
    const int draws = 20000;
    double published_m = 0.0;
    double as_is_m = 0.0;
    double square_m2 = 0.0;
    for (int i = 0; i < draws; ++i) {
      estimate.x = truth + draw(estimate.P, random);
      Object object;
      fill_object(estimate, Matrix8d::Zero(), object);
      const double error_m = object.ellipse_world.rx_m - object.ellipse_world.ry_m - difference_m;
      published_m += error_m / draws;
      square_m2 += error_m * error_m / draws;
      as_is_m += (2.0 * estimate.x.segment<2>(kAxis).norm() - difference_m) / draws;
      // The mean radius is not touched.
      EXPECT_NEAR(0.5 * (object.ellipse_world.rx_m + object.ellipse_world.ry_m), estimate.x(kShape), 1e-12);
    }
    const double error_of_mean_m = std::sqrt(square_m2 / draws);
    if (difference_m >= 0.1) {
      // The square root is not linear: what remains is of fourth order in sigma / |(p, q)|.
      const double remaining_m = difference_m * std::pow(2.0 * sigma_m / difference_m, 4);
      EXPECT_NEAR(published_m, 0.0, 3.0 * error_of_mean_m + 2.0 * remaining_m) << difference_m;
    }
    EXPECT_LT(std::abs(published_m), 0.65 * as_is_m) << difference_m;
  }
}

TEST(FillObject, TheAxisOfAPossibleCircleIsUnknown) {
  Random random(15);
  for (const double difference_m : {0.0, 1e-9, 0.005}) {
    ObjectEstimate estimate{state_of({{3.0, 1.0}, 0.4, 0.2 + difference_m, 0.2}),
                            random_covariance<Matrix8d>(random, 0.01)};
    Object object;
    fill_object(estimate, Matrix8d::Zero(), object);
    const int psi = object_error::kOrientation;
    EXPECT_EQ(object.covariance(psi, psi), kUniformAxisVariance);
    EXPECT_EQ(object.covariance.row(psi).cwiseAbs().sum(), kUniformAxisVariance);
    EXPECT_EQ(object.covariance.col(psi).cwiseAbs().sum(), kUniformAxisVariance);
    EXPECT_TRUE(object.covariance.allFinite());
    EXPECT_GE(smallest_eigenvalue(object.covariance), -1e-12);
    // The rest is what it is for a clear ellipse.
    EXPECT_EQ((object.covariance.topLeftCorner<4, 4>()), (estimate.P.topLeftCorner<4, 4>()));
  }
}

TEST(FillObject, BoundsTheAxisVarianceByThatOfAUniformOne) {
  Random random(16);
  for (int i = 0; i < 500; ++i) {
    ObjectEstimate estimate{state_of({{3.0, 1.0}, random.uniform(-kPi, kPi), 0.2 + random.uniform(0.0, 0.1), 0.2}),
                            random_covariance<Matrix8d>(random, random.uniform(0.001, 0.05))};
    Object object;
    fill_object(estimate, Matrix8d::Zero(), object);
    EXPECT_LE(object.covariance(object_error::kOrientation, object_error::kOrientation), kUniformAxisVariance);
  }
}

TEST(MakeCircle, IsAMeasurementOfNoDifferenceWithoutNoise) {
  Random random(17);
  for (int i = 0; i < 20; ++i) {
    const ObjectEstimate before{random_state(random), random_covariance<Matrix8d>(random, 0.05)};
    ObjectEstimate circle = before;
    make_circle(circle);
    // The same by the information form, with a noise next to nothing.
    Eigen::Matrix<double, 2, 8> H = Eigen::Matrix<double, 2, 8>::Zero();
    H.block<2, 2>(0, kAxis).setIdentity();
    const Matrix8d P_inverse = before.P.inverse();
    const double noise = 1e-10;
    const Matrix8d P = (P_inverse + H.transpose() * H / noise).inverse();
    EXPECT_LT((circle.P - P).cwiseAbs().maxCoeff(), 1e-6);
    EXPECT_LT((circle.x - P * P_inverse * before.x).norm(), 1e-4);
  }
}

TEST(MakeCircle, IsPermanent) {
  Random random(18);
  MatchedRun simulation(19);
  ObjectEstimate& estimate = simulation.estimate;
  estimate.P = random_covariance<Matrix8d>(random, 0.05);
  make_circle(estimate);
  estimate.x(kAngularVelocity) = 0.0;
  estimate.P.row(kAngularVelocity).setZero();
  estimate.P.col(kAngularVelocity).setZero();
  for (int i = 0; i < 200; ++i) {
    predict(estimate, 0.05, {0.5, 0.0, 0.01, 0.01, 0.0});
    const Measurement measurement = random_measurement(simulation.truth, {}, random);
    update(estimate, {}, measurement, match(estimate, {}, measurement, simulation.U), simulation.U);
    bound_radii(estimate.x, 0.01);
    EXPECT_EQ(estimate.x.tail<2>(), Eigen::Vector2d::Zero());
    EXPECT_EQ(estimate.P.bottomRows<2>().norm(), 0.0);
    EXPECT_EQ(estimate.P.rightCols<2>().norm(), 0.0);
    Object object;
    fill_object(estimate, Matrix8d::Zero(), object);
    EXPECT_EQ(object.ellipse_world.rx_m, object.ellipse_world.ry_m);
    EXPECT_EQ(object.covariance(object_error::kOrientation, object_error::kOrientation), kUniformAxisVariance);
    EXPECT_NEAR(object.covariance(object_error::kRadii, object_error::kRadii),
                object.covariance(object_error::kRadii, object_error::kRadii + 1), 1e-15);
  }
}

TEST(BoundRadii, KeepsBothAndTheAxis) {
  Vector8d x = state_of({{0.0, 0.0}, 0.6, 0.3, 0.2});
  const Vector8d untouched = x;
  bound_radii(x, 0.1);
  EXPECT_EQ(x, untouched);
  x.segment<2>(kAxis) *= 10.0;  // ry = 0.25 - 0.5 < 0
  bound_radii(x, 0.1);
  EXPECT_NEAR(ellipse_world(x).ry_m, 0.1, 1e-12);
  EXPECT_NEAR(ellipse_world(x).psi_rad, 0.6, 1e-12);
  x(kShape) = -1.0;
  bound_radii(x, 0.1);
  EXPECT_NEAR(ellipse_world(x).rx_m, 0.1, 1e-12);
  EXPECT_NEAR(ellipse_world(x).ry_m, 0.1, 1e-12);
}

// After a step of a century, say, a variance may be left with a rounding error that is larger than itself.
TEST(ObjectFilter, ANegativeVarianceByRoundingDoesNotLengthenAnAxis) {
  ObjectEstimate estimate;
  estimate.x.segment<3>(kShape) << 0.25, 1e-3, 0.0;
  estimate.P(kShape + 2, kShape + 2) = -68.0;
  Object object;
  fill_object(estimate, Matrix8d::Zero(), object);
  EXPECT_DOUBLE_EQ(object.ellipse_world.rx_m, 0.251);
  EXPECT_DOUBLE_EQ(object.ellipse_world.ry_m, 0.249);
}

}  // namespace
}  // namespace situation_awareness::object_filter_test

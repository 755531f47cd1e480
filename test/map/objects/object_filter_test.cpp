// SPDX-License-Identifier: BSD-3-Clause
#include "situation_awareness/map/objects/object_filter.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <functional>

#include <Eigen/Cholesky>
#include <Eigen/Eigenvalues>

#include "situation_awareness/common/random.hpp"
#include "situation_awareness/estimation/gating.hpp"
#include "situation_awareness/geometry/angles.hpp"

namespace situation_awareness {
namespace {

using namespace object_error;

ObjectState random_state(Random& random) {
  ObjectState x;
  x.position_world_m = {random.uniform(-5.0, 5.0), random.uniform(-5.0, 5.0)};
  x.velocity_world_m_s = {random.normal(), random.normal()};
  x.orientation_world = std::polar(1.0, random.uniform(-kPi, kPi));
  x.angular_velocity_rad_s = random.normal();
  x.radii_m = {random.uniform(0.3, 0.5), random.uniform(0.1, 0.3)};
  return x;
}

Pose2 random_pose(Random& random) {
  return {{random.uniform(-5.0, 5.0), random.uniform(-5.0, 5.0)}, random.uniform(-kPi, kPi)};
}

Pose2 moved(const Pose2& T, const Eigen::Vector3d& du) { return {T.translation_m + du.head<2>(), T.yaw_rad + du(2)}; }

template <int Rows, int Columns>
using Function = std::function<Eigen::Matrix<double, Rows, 1>(const Eigen::Matrix<double, Columns, 1>&)>;

/// Central differences about zero.
template <int Rows, int Columns>
Eigen::Matrix<double, Rows, Columns> numerical_jacobian(const Function<Rows, Columns>& f) {
  constexpr double kStep = 1e-5;
  Eigen::Matrix<double, Rows, Columns> J;
  for (int k = 0; k < Columns; ++k) {
    const Eigen::Matrix<double, Columns, 1> d = kStep * Eigen::Matrix<double, Columns, 1>::Unit(k);
    J.col(k) = (f(d) - f(-d)) / (2.0 * kStep);
  }
  return J;
}

template <int Size>
Eigen::Matrix<double, Size, 1> normal_vector(Random& random) {
  Eigen::Matrix<double, Size, 1> v;
  for (int i = 0; i < Size; ++i) v(i) = random.normal();
  return v;
}

template <class Matrix>
Matrix random_covariance(Random& random, double sigma) {
  Matrix L;
  for (int i = 0; i < L.rows(); ++i) {
    for (int j = 0; j < L.cols(); ++j) L(i, j) = sigma * random.normal();
  }
  return L * L.transpose() + 0.1 * sigma * sigma * Matrix::Identity();
}

TEST(ObjectFilter, BoxplusAndBoxminusUndoEachOther) {
  Random random(1);
  for (int i = 0; i < 100; ++i) {
    const ObjectState a = random_state(random);
    const ObjectState b = random_state(random);
    const Vector8d dx = boxminus(a, b);
    EXPECT_LT(boxminus(boxplus(b, dx), a).norm(), 1e-12);
    EXPECT_LT(boxminus(a, a).norm(), 1e-12);
  }
}

TEST(ObjectFilter, JacobiansEqualNumericalOnes) {
  Random random(2);
  for (int i = 0; i < 50; ++i) {
    const ObjectState x = random_state(random);
    const Pose2 T = random_pose(random);
    const double dt_s = random.uniform(0.0, 2.0);

    const Matrix8d F = numerical_jacobian<8, 8>(
        [&](const Vector8d& dx) { return boxminus(predict(boxplus(x, dx), dt_s), predict(x, dt_s)); });
    EXPECT_LT((F - process_jacobian(dt_s)).cwiseAbs().maxCoeff(), 1e-8);

    const Ellipse h = measure(x, T);
    const Matrix58d H =
        numerical_jacobian<5, 8>([&](const Vector8d& dx) { return innovation(measure(boxplus(x, dx), T), h); });
    EXPECT_LT((H - measurement_jacobian(T)).cwiseAbs().maxCoeff(), 1e-8);

    const Matrix53d H_u =
        numerical_jacobian<5, 3>([&](const Eigen::Vector3d& du) { return innovation(measure(x, moved(T, du)), h); });
    EXPECT_LT((H_u - measurement_input_jacobian(x, T)).cwiseAbs().maxCoeff(), 1e-6);

    const auto mapped = [&](const Vector5d& dz) {
      return map_measurement({h.center_m + dz.head<2>(), h.psi_rad + dz(2), h.rx_m + dz(3), h.ry_m + dz(4)}, T);
    };
    const auto G =
        numerical_jacobian<8, 5>([&](const Vector5d& dz) { return boxminus(mapped(dz), map_measurement(h, T)); });
    EXPECT_LT((G - mapping_jacobian(T)).cwiseAbs().maxCoeff(), 1e-8);

    const auto G_u = numerical_jacobian<8, 3>(
        [&](const Eigen::Vector3d& du) { return boxminus(map_measurement(h, moved(T, du)), map_measurement(h, T)); });
    EXPECT_LT((G_u - mapping_input_jacobian(h, T)).cwiseAbs().maxCoeff(), 1e-6);
  }
}

TEST(ObjectFilter, MappingAndMeasuringUndoEachOther) {
  Random random(3);
  for (int i = 0; i < 50; ++i) {
    const ObjectState x = random_state(random);
    const Pose2 T = random_pose(random);
    EXPECT_LT(innovation(measure(map_measurement(measure(x, T), T), T), measure(x, T)).norm(), 1e-9);
  }
}

TEST(ObjectFilter, OneLongStepPredictsAsManyShortOnes) {
  Random random(4);
  const ProcessNoise noise{0.7, 0.4, 0.02};
  const ObjectState x0 = random_state(random);
  const Matrix8d P0 = random_covariance<Matrix8d>(random, 0.3);
  ObjectState x = x0;
  Matrix8d P = P0;
  const int steps = 64;
  for (int i = 0; i < steps; ++i) {
    const double dt_s = 1.6 / steps;
    x = predict(x, dt_s);
    P = process_jacobian(dt_s) * P * process_jacobian(dt_s).transpose() + process_covariance(dt_s, noise);
  }
  EXPECT_LT(boxminus(x, predict(x0, 1.6)).norm(), 1e-9);
  const Matrix8d P_long =
      process_jacobian(1.6) * P0 * process_jacobian(1.6).transpose() + process_covariance(1.6, noise);
  EXPECT_LT((P - P_long).cwiseAbs().maxCoeff(), 1e-9);
}

TEST(ObjectFilter, EquivalentMeasurementsAreTheSameCurve) {
  const Measurement measurement{{{2.0, 1.0}, 0.3, 0.4, 0.2}, Matrix5d::Identity()};
  for (const Measurement& same : equivalent_measurements(measurement)) {
    EXPECT_LT((shape_matrix(same.ellipse_level) - shape_matrix(measurement.ellipse_level)).norm(), 1e-12);
  }
}

// Sect. V-C of the ellipse paper, and its extension to swapped radii: whichever way a detection describes the curve,
// the element is corrected the same.
TEST(ObjectFilter, TheDescriptionOfTheMeasuredCurveDoesNotMatter) {
  Random random(5);
  for (int i = 0; i < 50; ++i) {
    const ObjectState x = random_state(random);
    const Matrix8d P = random_covariance<Matrix8d>(random, 0.05);
    const Pose2 T = random_pose(random);
    const Measurement measurement{measure(boxplus(x, 0.05 * normal_vector<8>(random)), T),
                                  random_covariance<Matrix5d>(random, 0.03)};
    ObjectState expected_x = x;
    Matrix8d expected_P = P;
    update(expected_x, expected_P, T, match(x, P, T, measurement, Eigen::Matrix3d::Zero()), Eigen::Matrix3d::Zero());
    for (const Measurement& same : equivalent_measurements(measurement)) {
      ObjectState updated_x = x;
      Matrix8d updated_P = P;
      const Match m = match(x, P, T, same, Eigen::Matrix3d::Zero());
      EXPECT_LT(std::abs(m.nu(2)), kPi / 2.0);
      update(updated_x, updated_P, T, m, Eigen::Matrix3d::Zero());
      EXPECT_LT(boxminus(updated_x, expected_x).norm(), 1e-9);
      EXPECT_LT((updated_P - expected_P).norm(), 1e-9);
    }
  }
}

TEST(ObjectFilter, RigidMotionOfTheWorldMovesTheEstimateWithIt) {
  Random random(6);
  for (int i = 0; i < 50; ++i) {
    const ObjectState x = random_state(random);
    const Matrix8d P = random_covariance<Matrix8d>(random, 0.05);
    const Pose2 T = random_pose(random);
    const Pose2 motion = random_pose(random);
    const Measurement measurement{measure(boxplus(x, 0.05 * normal_vector<8>(random)), T),
                                  random_covariance<Matrix5d>(random, 0.03)};
    const Eigen::Matrix3d U = Eigen::Vector3d(1e-4, 1e-4, 1e-5).asDiagonal();

    const auto turned_state = [&](const ObjectState& s) {
      ObjectState t = s;
      t.position_world_m = motion * s.position_world_m;
      t.velocity_world_m_s = motion.rotation() * s.velocity_world_m_s;
      t.orientation_world *= std::polar(1.0, motion.yaw_rad);
      return t;
    };
    Matrix8d turn = Matrix8d::Identity();
    turn.block<2, 2>(kPosition, kPosition) = motion.rotation();
    turn.block<2, 2>(kVelocity, kVelocity) = motion.rotation();

    ObjectState a = x;
    Matrix8d P_a = P;
    update(a, P_a, T, match(a, P_a, T, measurement, U), U);
    ObjectState b = turned_state(x);
    Matrix8d P_b = turn * P * turn.transpose();
    update(b, P_b, motion * T, match(b, P_b, motion * T, measurement, U), U);
    EXPECT_LT(boxminus(b, turned_state(a)).norm(), 1e-9);
    EXPECT_LT((P_b - turn * P_a * turn.transpose()).cwiseAbs().maxCoeff(), 1e-9);
  }
}

TEST(ObjectFilter, UpdateOfALinearCaseEqualsTheInformationForm) {
  Random random(7);
  const Pose2 T = random_pose(random);
  const ObjectState x = random_state(random);
  const Matrix8d P = random_covariance<Matrix8d>(random, 0.05);
  const Measurement measurement{measure(boxplus(x, 0.02 * normal_vector<8>(random)), T),
                                random_covariance<Matrix5d>(random, 0.03)};
  const Match m = match(x, P, T, measurement, Eigen::Matrix3d::Zero());
  ObjectState updated_x = x;
  Matrix8d updated_P = P;
  update(updated_x, updated_P, T, m, Eigen::Matrix3d::Zero());
  const Matrix58d H = measurement_jacobian(T);
  const Matrix5d R_inverse = m.measurement.covariance.inverse();
  const Matrix8d expected_P = (P.inverse() + H.transpose() * R_inverse * H).inverse();
  const Vector8d expected_dx = expected_P * H.transpose() * R_inverse * m.nu;
  EXPECT_LT((updated_P - expected_P).cwiseAbs().maxCoeff(), 1e-9);
  EXPECT_LT((boxminus(updated_x, x) - expected_dx).norm(), 1e-9);
}

/// A matched simulation: truth, process, robot pose and measurements drawn from the very models the filter holds.
struct MatchedRun {
  explicit MatchedRun(std::uint64_t seed) : random(seed) {
    truth = random_state(random);
    truth.velocity_world_m_s *= 0.3;
    truth.angular_velocity_rad_s *= 0.1;
    truth.radii_m = {0.45, 0.2};
    R = Vector5d(0.02, 0.02, 0.05, 0.02, 0.02).array().square().matrix().asDiagonal();
    U = Eigen::Vector3d(0.01, 0.01, 0.002).array().square().matrix().asDiagonal();
    P = Vector8d(0.05, 0.05, 0.3, 0.3, 0.1, 0.1, 0.03, 0.03).array().square().matrix().asDiagonal();
    const Matrix8d root = P.llt().matrixL();
    x = boxplus(truth, root * normal_vector<8>(random));
  }

  void step() {
    const double dt_s = random.uniform(0.02, 0.1);
    const Matrix8d Q = process_covariance(dt_s, noise);
    truth = predict(truth, dt_s);
    truth = boxplus(truth, Q.llt().matrixL() * normal_vector<8>(random));

    x = predict(x, dt_s);
    P = process_jacobian(dt_s) * P * process_jacobian(dt_s).transpose() + Q;

    // The robot circles the object; the filter is told a noisy pose.
    angle_rad += 0.02;
    const Pose2 T_true{truth.position_world_m + Eigen::Vector2d(-3.0 * std::cos(angle_rad), -3.0 * std::sin(angle_rad)),
                       angle_rad};
    const Pose2 T_given = moved(T_true, U.llt().matrixL() * normal_vector<3>(random));
    Ellipse z = measure(truth, T_true);
    const Vector5d n = R.llt().matrixL() * normal_vector<5>(random);
    z = {z.center_m + n.head<2>(), z.psi_rad + n(2), z.rx_m + n(3), z.ry_m + n(4)};
    const Match m = match(x, P, T_given, {canonical(z), R}, U);
    nis = m.mahalanobis2;
    update(x, P, T_given, m, U);
  }

  double nees() const {
    const Vector8d error = boxminus(truth, x);
    return error.dot(P.ldlt().solve(error));
  }

  Random random;
  ProcessNoise noise{0.2, 0.1, 0.002};
  ObjectState truth;
  ObjectState x;
  Matrix8d P;
  Matrix5d R;
  Eigen::Matrix3d U;
  double angle_rad = 0.0;
  double nis = 0.0;
};

TEST(ObjectFilter, NeesAndNisOfFiftySeededRunsAreInsideTheir95PercentBands) {
  const int runs = 50;
  for (const int steps : {5, 50, 200}) {
    double nees_sum = 0.0;
    double nis_sum = 0.0;
    for (int run = 0; run < runs; ++run) {
      MatchedRun simulation(static_cast<std::uint64_t>(1000 * steps + run));
      for (int i = 0; i < steps; ++i) simulation.step();
      nees_sum += simulation.nees();
      nis_sum += simulation.nis;
    }
    // Sums over independent runs are chi-square distributed with as many degrees of freedom as they add up.
    EXPECT_GT(nees_sum, chi_square_quantile(0.025, 8.0 * runs)) << steps << " steps";
    EXPECT_LT(nees_sum, chi_square_quantile(0.975, 8.0 * runs)) << steps << " steps";
    EXPECT_GT(nis_sum, chi_square_quantile(0.025, 5.0 * runs)) << steps << " steps";
    EXPECT_LT(nis_sum, chi_square_quantile(0.975, 5.0 * runs)) << steps << " steps";
  }
}

TEST(ObjectFilter, CovarianceStaysSymmetricPositiveDefiniteOverAHundredThousandSteps) {
  MatchedRun simulation(42);
  double least_eigenvalue = 1e9;
  double most_asymmetry = 0.0;
  for (int i = 0; i < 100000; ++i) {
    simulation.step();
    most_asymmetry = std::max(most_asymmetry, (simulation.P - simulation.P.transpose()).cwiseAbs().maxCoeff());
    if (i % 10 == 0) {
      least_eigenvalue = std::min(
          least_eigenvalue,
          Eigen::SelfAdjointEigenSolver<Matrix8d>(simulation.P, Eigen::EigenvaluesOnly).eigenvalues().minCoeff());
    }
  }
  EXPECT_GT(least_eigenvalue, 0.0);
  EXPECT_EQ(most_asymmetry, 0.0);
  EXPECT_NEAR(std::abs(simulation.x.orientation_world), 1.0, 1e-12);
}

TEST(ObjectFilter, CanonicalIsTheSameElement) {
  Random random(9);
  ObjectState x = random_state(random);
  std::swap(x.radii_m.x(), x.radii_m.y());
  Matrix8d P = random_covariance<Matrix8d>(random, 0.1);
  const Pose2 T = random_pose(random);
  const Ellipse before = measure(x, T);
  const double rx_variance = P(kRadii, kRadii);
  make_canonical(x, P);
  EXPECT_GE(x.radii_m.x(), x.radii_m.y());
  EXPECT_LT((shape_matrix(measure(x, T)) - shape_matrix(before)).norm(), 1e-12);
  EXPECT_EQ(P(kRadii + 1, kRadii + 1), rx_variance);
}

}  // namespace
}  // namespace situation_awareness

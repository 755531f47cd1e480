// SPDX-License-Identifier: BSD-3-Clause
#include "situation_awareness/estimation/error_state_filter.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <limits>

#include <Eigen/Core>
#include <Eigen/LU>

#include "situation_awareness/common/random.hpp"
#include "situation_awareness/estimation/gating.hpp"
#include "situation_awareness/estimation/navigation_state.hpp"
#include "support/covariance.hpp"
#include "support/random_gaussian.hpp"

namespace situation_awareness::error_state_filter_test {
namespace {

using Vector4d = Eigen::Vector4d;
using Matrix4d = Eigen::Matrix4d;

template <int Size, int Columns>
Eigen::Matrix<double, Size, Columns> random_matrix(Random& random) {
  Eigen::Matrix<double, Size, Columns> result;
  for (int k = 0; k < Columns; ++k) result.col(k) = normal_vector<Size>(random);
  return result;
}

Estimate<Vector4d> random_estimate(Random& random) {
  return {normal_vector<4>(random), random_covariance<Matrix4d>(random, 0.5)};
}

// On R^n the kernel is the Kalman filter; the oracle is the least-squares problem that it solves, in information form.
template <int Size>
void expect_update_is_least_squares(Random& random) {
  const Estimate<Vector4d> before = random_estimate(random);
  const auto H = random_matrix<Size, 4>(random);
  const auto R = random_covariance<Eigen::Matrix<double, Size, Size>>(random, 0.3);
  const auto nu = normal_vector<Size>(random);
  const Innovation<Size> compared = innovation(before, nu, H, R);
  Estimate<Vector4d> after = before;
  update(after, compared, H, R);

  const Eigen::Matrix<double, Size, Size> R_inverse = R.inverse();
  const Matrix4d P = (before.P.inverse() + H.transpose() * R_inverse * H).inverse();
  EXPECT_LT((after.P - P).cwiseAbs().maxCoeff(), 1e-9);
  EXPECT_LT((after.x - before.x - P * H.transpose() * R_inverse * nu).norm(), 1e-8);
  EXPECT_EQ(after.P, after.P.transpose());

  // And the likelihood is the normal density of the innovation.
  const Eigen::Matrix<double, Size, Size> S = H * before.P * H.transpose() + R;
  EXPECT_NEAR(compared.mahalanobis2, nu.dot(S.inverse() * nu), 1e-8 * compared.mahalanobis2);
  EXPECT_NEAR(compared.log_likelihood, -0.5 * (nu.dot(S.inverse() * nu) + std::log((2.0 * kPi * S).determinant())),
              1e-8 * (1.0 + compared.mahalanobis2));
}

TEST(ErrorStateFilter, UpdateSolvesTheLeastSquaresProblem) {
  Random random(1);
  for (int i = 0; i < 50; ++i) {
    expect_update_is_least_squares<1>(random);
    expect_update_is_least_squares<3>(random);
  }
}

TEST(ErrorStateFilter, PredictionTransformsTheCovarianceByItsJacobian) {
  Random random(2);
  for (int i = 0; i < 20; ++i) {
    Estimate<Vector4d> estimate = random_estimate(random);
    const auto F = random_matrix<4, 4>(random);
    const auto Q = random_covariance<Matrix4d>(random, 0.1);
    const Matrix4d expected = F * estimate.P * F.transpose() + Q;
    const Vector4d x_predicted = F * estimate.x;
    predict(estimate, x_predicted, F, Q);
    EXPECT_EQ(estimate.x, x_predicted);
    EXPECT_LT((estimate.P - expected).cwiseAbs().maxCoeff(), 1e-12);
    EXPECT_EQ(estimate.P, estimate.P.transpose());
  }
}

// Two measurements one after the other, or both at once.
TEST(ErrorStateFilter, TheOrderOfMeasurementsDoesNotMatterOnFlatSpaces) {
  Random random(3);
  for (int i = 0; i < 20; ++i) {
    const Estimate<Vector4d> before = random_estimate(random);
    const auto H = random_matrix<3, 4>(random);
    const Eigen::Matrix<double, 1, 4> H_a = H.topRows<1>();
    const Eigen::Matrix<double, 2, 4> H_b = H.bottomRows<2>();
    const auto R_a = random_covariance<Eigen::Matrix<double, 1, 1>>(random, 0.3);
    const auto R_b = random_covariance<Eigen::Matrix2d>(random, 0.3);
    Eigen::Matrix3d R = Eigen::Matrix3d::Zero();
    R.topLeftCorner<1, 1>() = R_a;
    R.bottomRightCorner<2, 2>() = R_b;
    const auto z = normal_vector<3>(random);
    const auto take = [&z](Estimate<Vector4d>& estimate, int first, const auto& H_part, const auto& R_part) {
      constexpr int kSize = std::decay_t<decltype(R_part)>::RowsAtCompileTime;
      const Eigen::Matrix<double, kSize, 1> nu = z.segment<kSize>(first) - H_part * estimate.x;
      update(estimate, innovation(estimate, nu, H_part, R_part), H_part, R_part);
    };
    Estimate<Vector4d> both = before;
    take(both, 0, H, R);
    Estimate<Vector4d> a_then_b = before;
    take(a_then_b, 0, H_a, R_a);
    take(a_then_b, 1, H_b, R_b);
    Estimate<Vector4d> b_then_a = before;
    take(b_then_a, 1, H_b, R_b);
    take(b_then_a, 0, H_a, R_a);
    for (const Estimate<Vector4d>& estimate : {a_then_b, b_then_a}) {
      EXPECT_LT((estimate.x - both.x).norm(), 1e-9);
      EXPECT_LT((estimate.P - both.P).cwiseAbs().maxCoeff(), 1e-9);
    }
  }
}

TEST(ErrorStateFilter, AMeasurementWithoutNoiseDeterminesTheState) {
  Random random(4);
  for (int i = 0; i < 20; ++i) {
    Estimate<Vector4d> estimate = random_estimate(random);
    const auto H = random_matrix<2, 4>(random);
    const Eigen::Matrix2d R = Eigen::Matrix2d::Zero();
    const Eigen::Vector2d nu = Eigen::Vector2d(1.0, -2.0) - H * estimate.x;
    update(estimate, innovation(estimate, nu, H, R), H, R);
    EXPECT_LT((H * estimate.x - Eigen::Vector2d(1.0, -2.0)).norm(), 1e-9);
    EXPECT_LT((H * estimate.P * H.transpose()).norm(), 1e-9);
    EXPECT_TRUE(is_covariance(estimate.P));
  }
}

TEST(ErrorStateFilter, TheGatePassesItsProbabilityOfTrueMeasurements) {
  Random random(5);
  const Estimate<Vector4d> estimate = random_estimate(random);
  const auto H = random_matrix<3, 4>(random);
  const auto R = random_covariance<Eigen::Matrix3d>(random, 0.3);
  const Eigen::Matrix3d S = H * estimate.P * H.transpose() + R;
  for (const double probability : {0.5, 0.9, 0.99}) {
    const double gate = chi_square_quantile(probability, 3);
    const int draws = 20000;
    int inside = 0;
    for (int i = 0; i < draws; ++i) inside += inside_gate(innovation(estimate, draw(S, random), H, R), gate) ? 1 : 0;
    EXPECT_NEAR(inside, probability * draws, 3.5 * std::sqrt(draws * probability * (1.0 - probability))) << probability;
  }
}

TEST(ErrorStateFilter, NaNsAndInvalidCovariancesPassNoGate) {
  Random random(6);
  const Estimate<Vector4d> estimate = random_estimate(random);
  const auto H = random_matrix<2, 4>(random);
  const Eigen::Matrix2d R = Eigen::Matrix2d::Identity();
  const double nan = std::numeric_limits<double>::quiet_NaN();
  const double infinity = std::numeric_limits<double>::infinity();
  EXPECT_TRUE(inside_gate(innovation(estimate, Eigen::Vector2d(0.0, 0.0), H, R), 1.0));
  EXPECT_FALSE(inside_gate(innovation(estimate, Eigen::Vector2d(nan, 0.0), H, R), infinity));
  EXPECT_FALSE(inside_gate(innovation(estimate, Eigen::Vector2d(0.0, infinity), H, R), 1e300));
  for (const double variance : {nan, -1e6}) {
    const Eigen::Matrix2d no_covariance = variance * R;
    const Innovation<2> compared = innovation(estimate, Eigen::Vector2d(0.0, 0.0), H, no_covariance);
    EXPECT_FALSE(inside_gate(compared, infinity)) << variance;
    EXPECT_TRUE(std::isnan(compared.log_likelihood)) << variance;
  }
}

/// The error that remains after an update, and its covariance, for a measurement of all of the error: known without a
/// filter. If the truth is x [+] e and e is measured as e + noise, then with next to no noise the state is the truth,
/// and its covariance that of the noise about the truth.
template <class State>
void expect_reset_is_seen_from_the_corrected_state() {
  using M = Manifold<State>;
  constexpr int kSize = M::kDimension;
  Random random(7);
  for (int i = 0; i < 20; ++i) {
    Estimate<State> estimate;
    estimate.P = ErrorMatrix<State>::Identity();
    const ErrorVector<State> e = 0.5 * normal_vector<kSize>(random);
    const ErrorMatrix<State> R = random_covariance<ErrorMatrix<State>>(random, 1e-4);
    const State truth = M::retract(estimate.x, e);
    const ErrorMatrix<State> H = ErrorMatrix<State>::Identity();
    update(estimate, innovation(estimate, e, H, R), H, R);
    EXPECT_LT(M::local_coordinates(truth, estimate.x).norm(), 1e-4);

    // The covariance of many draws of the noise, each injected into the state.
    ErrorMatrix<State> sum = ErrorMatrix<State>::Zero();
    const int draws = 4000;
    for (int k = 0; k < draws; ++k) {
      const ErrorVector<State> noisy = e + draw(R, random);
      const ErrorVector<State> left = M::local_coordinates(truth, M::retract(M::identity(), noisy));
      sum += left * left.transpose() / draws;
    }
    const ErrorVector<State> sigma = estimate.P.diagonal().cwiseSqrt();
    const ErrorMatrix<State> difference =
        sigma.cwiseInverse().asDiagonal() * (sum - estimate.P) * sigma.cwiseInverse().asDiagonal();
    EXPECT_LT(difference.cwiseAbs().maxCoeff(), 5.0 * std::sqrt(2.0 / draws));
  }
}

TEST(ErrorStateFilter, CovarianceIsThatOfTheErrorAboutTheCorrectedState) {
  expect_reset_is_seen_from_the_corrected_state<Pose2>();
  expect_reset_is_seen_from_the_corrected_state<NavigationState>();
}

}  // namespace
}  // namespace situation_awareness::error_state_filter_test

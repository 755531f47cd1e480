// SPDX-License-Identifier: BSD-3-Clause
#include "situation_awareness/estimation/manifold.hpp"

#include <gtest/gtest.h>

#include <cmath>

#include <Eigen/Core>
#include <Eigen/Geometry>

#include "situation_awareness/common/random.hpp"
#include "situation_awareness/estimation/navigation_state.hpp"
#include "situation_awareness/geometry/angles.hpp"
#include "support/manifold_jacobian.hpp"
#include "support/random_gaussian.hpp"

namespace situation_awareness::manifold_test {
namespace {

template <class State>
double most_turn_rad(const ErrorVector<State>&) {
  return 0.0;
}
template <>
double most_turn_rad<Pose2>(const Eigen::Vector3d& e) {
  return std::abs(e(2));
}
template <>
double most_turn_rad<NavigationState>(const ErrorVector<NavigationState>& e) {
  return e.segment<3>(navigation_error::kAttitude).norm();
}

template <class State>
State random_state(Random& random) {
  return Manifold<State>::retract(Manifold<State>::identity(),
                                  3.0 * normal_vector<Manifold<State>::kDimension>(random));
}

/// An error that turns by less than half a turn.
template <class State>
ErrorVector<State> random_error(Random& random, double size) {
  ErrorVector<State> e;
  do {
    e = size * normal_vector<Manifold<State>::kDimension>(random);
  } while (most_turn_rad<State>(e) > 0.99 * kPi);
  return e;
}

template <class State>
struct ManifoldTest : ::testing::Test {};
using States = ::testing::Types<Eigen::Matrix<double, 1, 1>, Eigen::Matrix<double, 8, 1>, Pose2, NavigationState>;
TYPED_TEST_SUITE(ManifoldTest, States);

TYPED_TEST(ManifoldTest, RetractAndLocalCoordinatesUndoEachOther) {
  using M = Manifold<TypeParam>;
  Random random(1);
  for (const double size : {1e-9, 1e-3, 1.0}) {
    for (int i = 0; i < 100; ++i) {
      const auto x = random_state<TypeParam>(random);
      const auto y = random_state<TypeParam>(random);
      const auto e = random_error<TypeParam>(random, size);
      EXPECT_LT((M::local_coordinates(x, M::retract(x, e)) - e).norm(), 1e-11);
      // The error between equal states is zero.
      EXPECT_LT(M::local_coordinates(y, M::retract(x, M::local_coordinates(x, y))).norm(), 1e-11);
      EXPECT_LT(M::local_coordinates(x, x).norm(), 1e-12);
    }
  }
}

TYPED_TEST(ManifoldTest, SmallErrorsAdd) {
  using M = Manifold<TypeParam>;
  Random random(2);
  for (int i = 0; i < 100; ++i) {
    const auto x = random_state<TypeParam>(random);
    const auto J = manifold_jacobian<TypeParam>([](const TypeParam& at) { return at; }, x);
    EXPECT_LT((J - ErrorMatrix<TypeParam>::Identity()).cwiseAbs().maxCoeff(), 1e-8);
    const auto a = random_error<TypeParam>(random, 1e-5);
    const auto b = random_error<TypeParam>(random, 1e-5);
    const auto there = M::retract(M::retract(x, a), b);
    EXPECT_LT((M::local_coordinates(x, there) - a - b).norm(), 2e-9);  // of second order
  }
}

// The remaining error after an error is injected into the state.
TYPED_TEST(ManifoldTest, ResetJacobianEqualsTheNumericalOne) {
  using M = Manifold<TypeParam>;
  Random random(3);
  for (int i = 0; i < 50; ++i) {
    const auto x = random_state<TypeParam>(random);
    const auto e = random_error<TypeParam>(random, 0.7);
    const auto corrected = M::retract(x, e);
    const auto numerical = manifold_jacobian<ErrorVector<TypeParam>>(
        [&](const ErrorVector<TypeParam>& d) -> ErrorVector<TypeParam> {
          return M::local_coordinates(corrected, M::retract(x, d));
        },
        e);
    if constexpr (M::kFlat) {
      EXPECT_LT((numerical - ErrorMatrix<TypeParam>::Identity()).cwiseAbs().maxCoeff(), 1e-8);
    } else {
      EXPECT_LT((numerical - M::reset_jacobian(e)).cwiseAbs().maxCoeff(), 1e-8);
    }
  }
}

TEST(ManifoldOfPose2, AMotionOfTheWorldChangesNoError) {
  using M = Manifold<Pose2>;
  Random random(4);
  for (int i = 0; i < 100; ++i) {
    const auto motion = random_state<Pose2>(random);
    const auto x = random_state<Pose2>(random);
    const auto y = random_state<Pose2>(random);
    EXPECT_LT((M::local_coordinates(motion * x, motion * y) - M::local_coordinates(x, y)).norm(), 1e-11);
  }
}

// The pose covariance of the map (objects.md): of x and y in the world and of yaw.
TEST(ManifoldOfPose2, ItsErrorsAreThoseOfPositionAndYawTurned) {
  Random random(5);
  for (int i = 0; i < 20; ++i) {
    const auto T = random_state<Pose2>(random);
    const auto J = manifold_jacobian<Eigen::Vector3d>(
        [](const Pose2& at) -> Eigen::Vector3d {
          return {at.translation_m.x(), at.translation_m.y(), at.yaw_rad};
        },
        T);
    Eigen::Matrix3d expected = Eigen::Matrix3d::Identity();
    expected.topLeftCorner<2, 2>() = T.rotation();
    EXPECT_LT((J - expected).cwiseAbs().maxCoeff(), 1e-8);
  }
}

TEST(ManifoldOfNavigationState, AMotionOfTheWorldRotatesOnlyTheErrorsOfPositionAndVelocity) {
  using namespace navigation_error;
  using M = Manifold<NavigationState>;
  Random random(6);
  for (int i = 0; i < 100; ++i) {
    const Eigen::Quaterniond turn = exp_so3(normal_vector<3>(random));
    const Eigen::Vector3d shift_m = normal_vector<3>(random);
    const auto moved = [&](const NavigationState& x) {
      NavigationState result = x;
      result.position_world_m = turn * x.position_world_m + shift_m;
      result.velocity_world_m_s = turn * x.velocity_world_m_s;
      result.q_world_imu = turn * x.q_world_imu;
      return result;
    };
    const auto x = random_state<NavigationState>(random);
    const auto y = random_state<NavigationState>(random);
    auto expected = M::local_coordinates(x, y);
    expected.segment<3>(kPosition) = turn * Eigen::Vector3d(expected.segment<3>(kPosition));
    expected.segment<3>(kVelocity) = turn * Eigen::Vector3d(expected.segment<3>(kVelocity));
    EXPECT_LT((M::local_coordinates(moved(x), moved(y)) - expected).norm(), 1e-11);
  }
}

TEST(ManifoldOfNavigationState, TheAttitudeStaysOfUnitLength) {
  Random random(7);
  NavigationState x;
  for (int i = 0; i < 100000; ++i) {
    x = Manifold<NavigationState>::retract(x, random_error<NavigationState>(random, 0.1));
  }
  EXPECT_NEAR(x.q_world_imu.norm(), 1.0, 1e-15);
}

}  // namespace
}  // namespace situation_awareness::manifold_test

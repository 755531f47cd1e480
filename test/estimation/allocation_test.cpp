// SPDX-License-Identifier: BSD-3-Clause
#include <gtest/gtest.h>

#include <cstdlib>

#include "allocations.hpp"
#include "situation_awareness/estimation/error_state_filter.hpp"
#include "situation_awareness/estimation/navigation_state.hpp"

namespace situation_awareness::estimation_allocation_test {
namespace {

template <class State, int Size>
void expect_no_allocation() {
  Estimate<State> estimate;
  estimate.P.setIdentity();
  const ErrorMatrix<State> F = ErrorMatrix<State>::Identity();
  const ErrorMatrix<State> Q = 0.01 * ErrorMatrix<State>::Identity();
  const Eigen::Matrix<double, Size, Manifold<State>::kDimension> H =
      Eigen::Matrix<double, Size, Manifold<State>::kDimension>::Identity();
  const Eigen::Matrix<double, Size, Size> R = Eigen::Matrix<double, Size, Size>::Identity();
  const Eigen::Matrix<double, Size, 1> nu = Eigen::Matrix<double, Size, 1>::Constant(0.1);
  const auto before = allocations().count;
  for (int i = 0; i < 10; ++i) {
    predict(estimate, estimate.x, F, Q);
    update(estimate, innovation(estimate, nu, H, R), H, R);
  }
  EXPECT_EQ(allocations().count - before, 0);
  EXPECT_LT(estimate.P(0, 0), 1.0);
}

TEST(ErrorStateFilter, AllocatesNothing) {
  const auto before = allocations().count;
  void* volatile memory = std::malloc(1);  // volatile: a compiler may remove an unused allocation
  std::free(memory);
  ASSERT_GT(allocations().count, before) << "allocations are not counted";
  expect_no_allocation<Eigen::Matrix<double, 8, 1>, 5>();
  expect_no_allocation<Pose2, 2>();
  expect_no_allocation<NavigationState, 3>();
}

}  // namespace
}  // namespace situation_awareness::estimation_allocation_test

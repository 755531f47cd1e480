// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <Eigen/Core>

#include "situation_awareness/estimation/manifold.hpp"

namespace situation_awareness {

/// d(f(x [+] e) [-] f(x)) / d(e) at e = 0 by central differences: the Jacobian of a function between manifolds, in the
/// errors of `To`, which f returns, by those of x.
template <class To, class From, class Function>
Eigen::Matrix<double, Manifold<To>::kDimension, Manifold<From>::kDimension> manifold_jacobian(const Function& f,
                                                                                              const From& x) {
  constexpr double kStep = 1e-5;
  const To f_x = f(x);
  Eigen::Matrix<double, Manifold<To>::kDimension, Manifold<From>::kDimension> J;
  for (int k = 0; k < Manifold<From>::kDimension; ++k) {
    const ErrorVector<From> d = kStep * ErrorVector<From>::Unit(k);
    const auto error_at = [&](const ErrorVector<From>& e) {
      return Manifold<To>::local_coordinates(f_x, f(Manifold<From>::retract(x, e)));
    };
    J.col(k) = (error_at(d) - error_at(-d)) / (2.0 * kStep);
  }
  return J;
}

}  // namespace situation_awareness

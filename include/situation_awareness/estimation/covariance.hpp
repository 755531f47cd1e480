// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <Eigen/Core>

namespace situation_awareness {

/// Up to 6 x 6, on the stack.
using SmallCovariance = Eigen::Matrix<double, Eigen::Dynamic, Eigen::Dynamic, 0, 6, 6>;

/// Whether the matrix is the covariance of something: finite, without a negative variance, and as correlations
/// symmetric and without a negative eigenvalue, each up to rounding (1e-6, in messages that went through other
/// arithmetic). That all variances are positive does not say it: [2.25 3; 3 2.25] has a direction of the variance
/// -0.75. Eigen's LLT and LDLT do not tell (Success for NaN, isPositive for [0 1; 1 0]).
bool is_positive_semidefinite(const SmallCovariance& C);

}  // namespace situation_awareness

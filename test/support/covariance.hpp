// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <Eigen/Core>

namespace situation_awareness {

// Compiled once, for matrices of any size: each decomposition of a fixed size costs the compiler seconds.

/// Symmetric to rounding, and no variance or eigenvalue below zero by more than rounding.
bool is_covariance(const Eigen::MatrixXd& P);

/// Of a symmetric matrix.
double smallest_eigenvalue(const Eigen::MatrixXd& P);

/// error' P^-1 error: of a normal error with this covariance it is chi-square of its dimension.
double mahalanobis2(const Eigen::VectorXd& error, const Eigen::MatrixXd& P);

}  // namespace situation_awareness

// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cmath>
#include <limits>

#include <Eigen/Core>

namespace situation_awareness {

// Small matrices of fixed size. Eigen's LLT and its solvers take products for matrices of any size inside: slower here,
// and each size takes the compiler a second and 50 MB of memory.

/// Lower triangular L with L L^T = S, of which the lower triangle is used; false if S is not positive definite.
template <int Size>
bool cholesky(const Eigen::Matrix<double, Size, Size>& S, Eigen::Matrix<double, Size, Size>& L) {
  L.setZero();
  for (int k = 0; k < Size; ++k) {
    double pivot = S(k, k);
    if (k > 0) {
      double sum = L(k, 0) * L(k, 0);
      for (int j = 1; j < k; ++j) sum += L(k, j) * L(k, j);
      pivot -= sum;
    }
    if (!(pivot > 0.0)) return false;
    L(k, k) = std::sqrt(pivot);
    for (int i = k + 1; i < Size; ++i) {
      double value = S(i, k);
      if (k > 0) {
        double sum = L(i, 0) * L(k, 0);
        for (int j = 1; j < k; ++j) sum += L(i, j) * L(k, j);
        value -= sum;
      }
      L(i, k) = value / L(k, k);
    }
  }
  return true;
}

/// factor_of() returns the L of cholesky(), or NaN if S is not positive definite.
template <int Size>
Eigen::Matrix<double, Size, Size> factor_of(const Eigen::Matrix<double, Size, Size>& S) {
  Eigen::Matrix<double, Size, Size> L;
  if (!cholesky(S, L)) L.setConstant(std::numeric_limits<double>::quiet_NaN());
  return L;
}

/// solve_lower() returns the X with L X = B, where L is lower triangular.
template <int Size, int Columns>
Eigen::Matrix<double, Size, Columns> solve_lower(const Eigen::Matrix<double, Size, Size>& L,
                                                 const Eigen::Matrix<double, Size, Columns>& B) {
  const Eigen::Matrix<double, Size, 1> inverse = L.diagonal().cwiseInverse();
  Eigen::Matrix<double, Size, Columns> X;
  for (int c = 0; c < Columns; ++c) {
    for (int r = 0; r < Size; ++r) {
      double value = B(r, c);
      for (int k = 0; k < r; ++k) value -= L(r, k) * X(k, c);
      X(r, c) = value * inverse(r);
    }
  }
  return X;
}

/// solve_cholesky() returns the X with L L^T X = B, where L is lower triangular: S^-1 B by the L of S.
template <int Size, int Columns>
Eigen::Matrix<double, Size, Columns> solve_cholesky(const Eigen::Matrix<double, Size, Size>& L,
                                                    const Eigen::Matrix<double, Size, Columns>& B) {
  const Eigen::Matrix<double, Size, 1> inverse = L.diagonal().cwiseInverse();
  Eigen::Matrix<double, Size, Columns> X = solve_lower(L, B);
  for (int c = 0; c < Columns; ++c) {
    for (int r = Size - 1; r >= 0; --r) {
      double value = X(r, c);
      for (int k = r + 1; k < Size; ++k) value -= L(k, r) * X(k, c);
      X(r, c) = value * inverse(r);
    }
  }
  return X;
}

/// inverse_of_lower() returns the inverse of a lower triangular L.
template <int Size>
Eigen::Matrix<double, Size, Size> inverse_of_lower(const Eigen::Matrix<double, Size, Size>& L) {
  return solve_lower(L, Eigen::Matrix<double, Size, Size>(Eigen::Matrix<double, Size, Size>::Identity()));
}

/// inverse_of_positive_definite() returns S^-1 by the lower triangle of S, or NaN if S is not positive
/// definite.
template <int Size>
Eigen::Matrix<double, Size, Size> inverse_of_positive_definite(const Eigen::Matrix<double, Size, Size>& S) {
  const Eigen::Matrix<double, Size, Size> inverse = inverse_of_lower(factor_of(S));
  return inverse.transpose().lazyProduct(inverse);
}

}  // namespace situation_awareness

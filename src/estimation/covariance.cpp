// SPDX-License-Identifier: BSD-3-Clause
#include "situation_awareness/estimation/covariance.hpp"

#include <cmath>

#include <Eigen/Cholesky>

namespace situation_awareness {

bool is_positive_semidefinite(const SmallCovariance& C) {
  constexpr double kRounding = 1e-6;
  if (C.rows() != C.cols() || !C.allFinite() || (C.diagonal().array() < 0.0).any()) return false;
  // As correlations, so that units do not count, and no square overflows.
  SmallCovariance scaled = C;
  for (Eigen::Index i = 0; i < C.rows(); ++i) {
    if (!(C(i, i) > 0.0)) continue;
    const double scale = 1.0 / std::sqrt(C(i, i));
    scaled.row(i) *= scale;
    scaled.col(i) *= scale;
  }
  if (!scaled.allFinite() || (scaled - scaled.transpose()).cwiseAbs().maxCoeff() > kRounding) return false;
  // No eigenvalue is below -kRounding where all are positive with that added.
  scaled.diagonal().array() += kRounding;
  return Eigen::LLT<SmallCovariance>(scaled).info() == Eigen::Success;
}

}  // namespace situation_awareness

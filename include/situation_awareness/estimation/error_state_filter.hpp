// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cmath>
#include <limits>

#include <Eigen/Core>

#include "situation_awareness/estimation/cholesky.hpp"
#include "situation_awareness/estimation/manifold.hpp"
#include "situation_awareness/geometry/angles.hpp"

namespace situation_awareness {

// The error-state (indirect) extended Kalman filter on a manifold (docs/math/estimation.md; Sola, "Quaternion
// kinematics for the error-state Kalman filter", 2017; circle paper, eqs. 21 to 30). The state x is a point of the
// manifold, its error e is a vector: x_true = x [+] e, e ~ N(0, P). Models are functions of their filter, with
// Jacobians by the error:
//
//   symbol  meaning                                                        space      size
//   x       state                                                          manifold
//   e, P    error of x and its covariance                                  R^n        n, nxn
//   f       process: x' = f(x)                                             manifold
//   F       d(f(x [+] e) [-] f(x)) / d(e) at e = 0                         J_e_e      nxn
//   Q      process noise of the step, in the errors of x'             R^nxn      nxn
//   z, R    measurement and the covariance of its noise                    R^m        mxm
//   nu      innovation: z - h(x), wrapped where z is an angle              R^m        m
//   H       d(h(x [+] e)) / d(e) at e = 0                                  J_z_e      mxn
//   S, K    covariance of nu; gain                                         R^mxm      mxm, nxm
//   G      reset Jacobian, after the estimate of e is in x             J_e_e      nxn
//
// Everything is of fixed size and on the stack: no allocation.

/// State estimate and covariance of a filter.
template <class State>
struct Estimate {
  State x = Manifold<State>::identity();
  ErrorMatrix<State> P = ErrorMatrix<State>::Zero();
};

/// Innovation of a measurement, its covariance and likelihood.
template <int Size>
struct Innovation {
  Eigen::Matrix<double, Size, 1> nu = Eigen::Matrix<double, Size, 1>::Zero();
  Eigen::Matrix<double, Size, Size> S = Eigen::Matrix<double, Size, Size>::Identity();
  double mahalanobis2 = 0.0;    ///< nu^T S^-1 nu, the normalised innovation squared (NIS): chi-square of Size
  double log_likelihood = 0.0;  ///< of the measurement: ln N(nu; 0, S)
};

/// A P A^T: the covariance P of e as that of A e. Eigen takes its product for large matrices from 7 x 7 on, which is
/// slower here by a factor of 2; the sums are the same.
template <int Rows, int Size>
Eigen::Matrix<double, Rows, Rows> transformed(const Eigen::Matrix<double, Rows, Size>& A,
                                              const Eigen::Matrix<double, Size, Size>& P) {
  const Eigen::Matrix<double, Rows, Size> AP = A.lazyProduct(P);
  return AP.lazyProduct(A.transpose());
}

/// Replace the state by `x_predicted`, f of it, whose Jacobian and noise are F and Q.
template <class State>
void predict(Estimate<State>& estimate, const State& x_predicted, const ErrorMatrix<State>& F,
             const ErrorMatrix<State>& Q) {
  const ErrorMatrix<State> P = transformed(F, estimate.P) + Q;
  estimate.P = 0.5 * (P + P.transpose());
  estimate.x = x_predicted;
}

/// The innovation `nu` of the covariance S, of which the lower triangle is used. If S is not positive definite or not
/// finite, mahalanobis2 and log_likelihood are NaN, which passes no gate.
template <int Size>
Innovation<Size> innovation(const Eigen::Matrix<double, Size, 1>& nu, const Eigen::Matrix<double, Size, Size>& S) {
  Innovation<Size> result;
  result.nu = nu;
  result.S = S;
  Eigen::Matrix<double, Size, Size> L;
  if (!cholesky(S, L)) {
    result.mahalanobis2 = result.log_likelihood = std::numeric_limits<double>::quiet_NaN();
    return result;
  }
  result.mahalanobis2 = solve_lower(L, nu).squaredNorm();
  const double log_det_S = 2.0 * L.diagonal().array().log().sum();
  result.log_likelihood = -0.5 * (result.mahalanobis2 + log_det_S + Size * std::log(2.0 * kPi));
  return result;
}

/// Compare a state with a measurement that differs by `nu` from its prediction. R is the covariance of all errors other
/// than that of x: of the measurement, and of inputs through their Jacobian; NaN as above if it was no covariance.
template <class State, int Size>
Innovation<Size> innovation(const Estimate<State>& estimate, const Eigen::Matrix<double, Size, 1>& nu,
                            const Eigen::Matrix<double, Size, Manifold<State>::kDimension>& H,
                            const Eigen::Matrix<double, Size, Size>& R) {
  return innovation(nu, Eigen::Matrix<double, Size, Size>(transformed(H, estimate.P) + R));
}

/// Whether the measurement is inside the gate: `gate` is chi_square_quantile(probability, Size) for the probability
/// that a true measurement passes. NaN does not pass.
template <int Size>
bool inside_gate(const Innovation<Size>& innovation, double gate) {
  return innovation.mahalanobis2 <= gate;
}

/// Correct the state by a measurement that has passed its gate, with the H and R of its innovation. P is updated in
/// Joseph's form, which keeps it symmetric positive semi-definite whatever the rounding of K, and then reset to the
/// error about the corrected state.
template <class State, int Size>
void update(Estimate<State>& estimate, const Innovation<Size>& innovation,
            const Eigen::Matrix<double, Size, Manifold<State>::kDimension>& H,
            const Eigen::Matrix<double, Size, Size>& R) {
  const Eigen::Matrix<double, Size, Manifold<State>::kDimension> HP = H.lazyProduct(estimate.P);
  const Eigen::Matrix<double, Manifold<State>::kDimension, Size> K =
      solve_cholesky(factor_of(innovation.S), HP).transpose();
  const ErrorMatrix<State> I_KH = ErrorMatrix<State>::Identity() - K * H;
  ErrorMatrix<State> P = transformed(I_KH, estimate.P) + transformed(K, R);
  const ErrorVector<State> e = K * innovation.nu;
  if constexpr (!Manifold<State>::kFlat) {
    const ErrorMatrix<State> G = Manifold<State>::reset_jacobian(e);
    P = transformed(G, P);
  }
  estimate.P = 0.5 * (P + P.transpose());
  estimate.x = Manifold<State>::retract(estimate.x, e);
}

}  // namespace situation_awareness

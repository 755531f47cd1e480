// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <Eigen/Core>

namespace situation_awareness {

/// The lower half of a symmetric matrix that is zero farther than `below` from its diagonal.
class BandMatrix {
 public:
  BandMatrix() = default;
  BandMatrix(const BandMatrix&) = default;
  BandMatrix& operator=(const BandMatrix& other);
  void reset(Eigen::Index size, Eigen::Index below);
  void swap(BandMatrix& other);
  /// row >= column
  double& operator()(Eigen::Index row, Eigen::Index column) { return entries_(column * below_ + row); }
  const double& operator()(Eigen::Index row, Eigen::Index column) const { return entries_(column * below_ + row); }
  void scale_diagonal(double factor);
  /// Overwrites it with its Cholesky factor, which the others are of.
  void factorize();
  void solve(Eigen::VectorXd& b) const;
  /// The entries of the inverse within the band (Takahashi et al., 1973).
  void invert(BandMatrix& inverse) const;

 private:
  Eigen::Index resize(Eigen::Index size, Eigen::Index below);

  Eigen::Index size_ = 0, below_ = 0;
  Eigen::VectorXd entries_;
};

}  // namespace situation_awareness

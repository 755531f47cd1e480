// SPDX-License-Identifier: BSD-3-Clause
#include "band_matrix.hpp"

#include <algorithm>
#include <cmath>
#include <utility>

namespace situation_awareness {
namespace {

// Where no source is named, none is recorded; the sensitivity of these was not measured.

/// The least pivot of the factorization of normal equations, whose entries are of 1 / m^2 and 1 / rad^2.
constexpr double kLeastPivot = 1e-6;

}  // namespace

/// Returns the number of entries.
Eigen::Index BandMatrix::resize(Eigen::Index size, Eigen::Index below) {
  size_ = size;
  below_ = below;
  const Eigen::Index entries = (below + 1) * size;
  if (entries_.size() < entries) entries_.resize(2 * entries);
  return entries;
}

void BandMatrix::reset(Eigen::Index size, Eigen::Index below) { entries_.head(resize(size, below)).setZero(); }

BandMatrix& BandMatrix::operator=(const BandMatrix& other) {
  const Eigen::Index entries = resize(other.size_, other.below_);
  entries_.head(entries) = other.entries_.head(entries);
  return *this;
}

void BandMatrix::swap(BandMatrix& other) {
  std::swap(size_, other.size_);
  std::swap(below_, other.below_);
  entries_.swap(other.entries_);
}

void BandMatrix::scale_diagonal(double factor) {
  for (Eigen::Index j = 0; j < size_; ++j) (*this)(j, j) *= factor;
}

void BandMatrix::factorize() {
  for (Eigen::Index j = 0; j < size_; ++j) {
    const Eigen::Index rows = std::min(below_, size_ - 1 - j);
    double* const column = &(*this)(j, j);
    const double root = std::sqrt(std::max(column[0], kLeastPivot));
    column[0] = root;
    for (Eigen::Index r = 1; r <= rows; ++r) column[r] /= root;
    for (Eigen::Index c = 1; c <= rows; ++c) {
      Eigen::Map<Eigen::VectorXd> other(&(*this)(j + c, j + c), rows - c + 1);
      other.noalias() -= column[c] * Eigen::Map<const Eigen::VectorXd>(column + c, rows - c + 1);
    }
  }
}

void BandMatrix::solve(Eigen::VectorXd& b) const {
  for (Eigen::Index j = 0; j < size_; ++j) {
    const double* const column = &(*this)(j, j);
    b(j) /= column[0];
    for (Eigen::Index r = 1; r <= std::min(below_, size_ - 1 - j); ++r) b(j + r) -= column[r] * b(j);
  }
  for (Eigen::Index j = size_ - 1; j >= 0; --j) {
    const double* const column = &(*this)(j, j);
    for (Eigen::Index r = 1; r <= std::min(below_, size_ - 1 - j); ++r) b(j) -= column[r] * b(j + r);
    b(j) /= column[0];
  }
}

void BandMatrix::invert(BandMatrix& inverse) const {
  inverse.reset(size_, below_);
  for (Eigen::Index j = size_ - 1; j >= 0; --j) {
    const double* const column = &(*this)(j, j);
    const Eigen::Index rows = std::min(below_, size_ - 1 - j);
    // The sums of all rows at once, as none of them waits for another then: each over k in order.
    double* const sums = &inverse(j, j);
    for (Eigen::Index k = 1; k <= rows; ++k) {
      for (Eigen::Index r = 1; r < k; ++r) sums[r] -= column[k] * inverse(j + k, j + r);
      const double* const other = &inverse(j + k, j + k);
      for (Eigen::Index r = k; r <= rows; ++r) sums[r] -= column[k] * other[r - k];
    }
    for (Eigen::Index r = 1; r <= rows; ++r) sums[r] /= column[0];
    double sum = 1.0 / column[0];
    for (Eigen::Index k = 1; k <= rows; ++k) sum -= column[k] * sums[k];
    sums[0] = sum / column[0];
  }
}

}  // namespace situation_awareness

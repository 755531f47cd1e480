// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <array>
#include <cstddef>
#include <vector>

#include <Eigen/Core>

#include "band_matrix.hpp"
#include "biarc_chain.hpp"
#include "boundary_elements.hpp"
#include "expected_jumps.hpp"

namespace situation_awareness {

/// Least squares of the places and tangents of a chain's nodes, with Huber's loss.
class BiarcLeastSquares {
 public:
  BiarcLeastSquares(const BoundaryElements& elements, const ExpectedJumps& jumps, BiarcChain& chain)
      : elements_(elements), jumps_(jumps), chain_(chain) {}

  /// Levenberg-Marquardt of so many steps at most, with the jumps that are expected.
  void iterate(int most);

  /// The covariance of the latest fit, which the variances below are of.
  void find_covariance();
  /// The variance of a node across a direction, times `scale`.
  double variance_across_m2(std::size_t node, double yaw_rad, double scale) const;
  /// The variance of what has this slope by x, y, yaw of a biarc's nodes, times `scale`.
  double variance_m2(std::size_t biarc, const BiarcChain::Vector6d& slope, double scale) const;

 private:
  using Vector6d = BiarcChain::Vector6d;
  using Matrix6d = Eigen::Matrix<double, 6, 6>;

  /// Unknowns of a node: along, across, yaw, at a corner the second yaw.
  struct Unknowns {
    Eigen::Index first;
    Eigen::Vector2d along;
  };
  /// Normal equations of a biarc's elements.
  struct Sums {
    Matrix6d H;
    Vector6d g;
    std::size_t elements;
  };

  Eigen::Index unknowns_at(std::size_t k) const { return chain_.nodes[k].corner ? 4 : 3; }
  std::array<Eigen::Index, 6> unknowns_of_biarc(std::size_t biarc, Matrix6d& J) const;
  double build();
  void add_to_row(const Vector6d& slope, std::size_t biarc);
  void add_sums(std::size_t biarc);
  double straighten(std::size_t biarc);
  void add_jump(std::size_t before, std::size_t after, double jump, double weight);
  void hold(BandMatrix& H) const;
  void factorize(double damping);
  void keep_order();
  void swap_with_before();

  const BoundaryElements& elements_;
  const ExpectedJumps& jumps_;
  BiarcChain& chain_;
  std::vector<Unknowns> unknowns_of_;
  Eigen::Index unknowns_ = 0;
  std::vector<Sums> sums_;
  BandMatrix H_, H_factor_, covariance_;
  Eigen::VectorXd g_, delta_, row_;
  /// The chain and its equations before a step, swapped back if the step makes the fit worse.
  std::vector<BiarcChain::Node> nodes_before_;
  std::vector<std::size_t> arc_of_before_;
  BandMatrix H_before_;
  Eigen::VectorXd g_before_;
  std::vector<Unknowns> unknowns_of_before_;
  std::vector<BiarcChain::Arc> arcs_before_;
  std::vector<BiarcChain::Residual> of_elements_before_;
};

}  // namespace situation_awareness

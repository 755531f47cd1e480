// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstddef>
#include <vector>

#include <Eigen/Core>

#include "situation_awareness/geometry/simplify.hpp"
#include "situation_awareness/map/polygons/polygons.hpp"

namespace situation_awareness {

/// An element of a boundary: a place, known across it.
struct BoundaryElement {
  Eigen::Vector2d p_world_m = Eigen::Vector2d::Zero();
  Eigen::Vector2d along_world = Eigen::Vector2d::UnitX();  ///< unit, from right to left
  double variance_m2 = 0.0;                                ///< across, above zero
  double low_m = 0.0, high_m = 0.0;                        ///< extent along it, from right to left
};

/// Makes chains of vertices of elements in order. It keeps its memory: no allocation after warm-up.
class ChainFit {
 public:
  /// The elements, at least one and from right to left, are simplified (`tolerance_m` and twice their standard
  /// deviations); each edge is the weighted least squares line of its elements without those at its corners, and
  /// vertices are intersections of edges. The order of the elements of a closed chain is rotated so that it begins at a
  /// corner. A closed chain without three corners is open. `vertices` is
  /// overwritten: two at least, of a closed chain three.
  void fit(std::vector<BoundaryElement>& elements, bool& closed, double tolerance_m,
           std::vector<ChainVertex>& vertices);

 private:
  /// A weighted least squares line, relative to the first element.
  struct FittedLine {
    Eigen::Vector2d through_m, normal;
    double offset_variance_m2, turn_variance, spread_m2;
    std::size_t elements;

    double sigma_at(const Eigen::Vector2d& p_m) const;
  };

  static bool crossing(const FittedLine& a, const FittedLine& b, Eigen::Vector2d& crossing_m);
  FittedLine line_of(const std::vector<BoundaryElement>& elements, bool closed, std::size_t edge) const;
  void find_corners(std::vector<BoundaryElement>& elements, bool closed, double tolerance_m);
  void drop_rounded_corners(const std::vector<BoundaryElement>& elements, bool closed);
  void straighten(const std::vector<BoundaryElement>& elements, bool closed, double tolerance_m);

  Simplification simplification_;
  std::vector<std::size_t> corners_;  ///< as indices of elements; the last of a closed chain is the first element again
  std::vector<FittedLine> lines_;
};

}  // namespace situation_awareness

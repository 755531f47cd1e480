// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstddef>
#include <vector>

#include <Eigen/Core>

#include "situation_awareness/map/splinegons/splinegon_fit.hpp"

namespace situation_awareness {

/// The elements that a boundary is fitted to, in order; places are relative to an origin.
class BoundaryElements {
 public:
  /// Elements that a main vertex needs, which has a place across the boundary and a heading.
  static constexpr std::size_t kElementsOfVertex = 3;
  /// Elements that tell the curvature of a biarc at a corner, at least.
  static constexpr std::size_t kElementsOfArc = 6;

  /// Elements on both sides of boundary without any.
  struct Gap {
    std::size_t last, next;
  };

  /// Takes the elements over, without those far from their neighbours. The variances are raised to what the elements
  /// show. False if they are too few, or extend over too little.
  bool take(const std::vector<SplinegonElement>& elements);
  /// Along the polygon of the elements, from one to another that is after it.
  double way_m(std::size_t from, std::size_t to) const;

  bool closed = false;
  bool follow_tips = true;  ///< where two neighbours are off
  Eigen::Vector2d origin_m = Eigen::Vector2d::Zero();
  std::vector<Eigen::Vector2d> points_m, normals;
  std::vector<double> weights;  ///< one over their standard deviations
  std::vector<double> s_m;      ///< along the polygon of the elements
  double perimeter_m = 0.0;     ///< of that polygon
  std::vector<Gap> gaps;

 private:
  std::vector<double> scratch_;
};

}  // namespace situation_awareness

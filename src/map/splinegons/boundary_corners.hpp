// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstddef>
#include <vector>

#include <Eigen/Core>

#include "boundary_elements.hpp"
#include "line_sums.hpp"

namespace situation_awareness {

/// A break of a boundary's tangent.
struct BoundaryCorner {
  // Where no source is named, none is recorded; the sensitivity of these was not measured.

  /// rad. Least break of the tangent that is a corner.
  static constexpr double kAngle_rad = 0.75;
  /// m. Length of the boundary to either side in which a corner's sides are compared with an arc.
  static constexpr double kWindow_m = 1.2;
  /// Least distance of two, over the window.
  static constexpr double kApart = 0.3;
  /// Least break of the tangent of a corner that stays one, over that of a new one.
  static constexpr double kLeastBreak = 0.7;

  double s_m;  ///< along the polygon of the elements
  Eigen::Vector2d p_m;
  double yaw_in_rad, yaw_out_rad, score;
};

/// Looks for corners: where two lines meet the elements better than an arc does.
class CornerSearch {
 public:
  explicit CornerSearch(const BoundaryElements& elements);

  void find();
  /// Along the boundary.
  const std::vector<BoundaryCorner>& corners() const { return corners_; }

 private:
  struct CornerSide;

  bool corner_after(std::size_t last, BoundaryCorner& corner) const;
  bool corner_between(std::size_t last, double window_m, const CornerSide& left_side, const CornerSide& right_side,
                      BoundaryCorner& corner) const;

  const BoundaryElements& elements_;
  double tan_of_straight_;  ///< of the turn of two lines below which there is no corner
  std::vector<BoundaryCorner> candidates_, corners_;
  std::vector<std::size_t> by_score_;
};

}  // namespace situation_awareness

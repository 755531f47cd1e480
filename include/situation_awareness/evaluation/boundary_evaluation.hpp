// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstddef>
#include <string>
#include <vector>

#include <Eigen/Core>

#include "situation_awareness/map/splinegons/splinegons.hpp"

namespace situation_awareness {

/// An obstacle in truth: its outline, closed, counter-clockwise.
struct TrueObstacle {
  std::string name;
  std::vector<Eigen::Vector2d> outline_world_m;
};

/// How well the boundary of an obstacle is known.
struct BoundaryScore {
  std::string name;
  std::size_t boundaries = 0;     ///< that are nearest to it; those in excess of one are false
  bool closed = false;            ///< the longest of them
  std::size_t vertices = 0;       ///< joints included
  double hausdorff_m = 0.0;       ///< greatest distance of either outline from the other; infinity without a boundary
  double mean_m = 0.0;            ///< mean distance of the boundary's places from the true outline
  double area_part = 0.0;         ///< area less the true one, over that; NaN if open
  double sigma_m = 0.0;           ///< mean along the boundary
  double in_envelope_part = 0.0;  ///< of the true outline, that is in the 99 % envelope
};

/// One score for each obstacle. A boundary counts for the obstacle that it is nearest to, on the mean.
std::vector<BoundaryScore> score_boundaries(const std::vector<TrueObstacle>& obstacles, const Splinegons& splinegons);

/// A table of the scores.
std::string format_table(const std::vector<BoundaryScore>& scores);

}  // namespace situation_awareness

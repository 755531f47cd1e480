// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstddef>
#include <cstdint>
#include <vector>

#include <Eigen/Core>

namespace situation_awareness {

/// A 2.5D map of one class: for each cell, a square of the world's x and y, the probability that something of the class
/// stands there, on the ground of the elevation. Cells lie on multiples of their size. Rows from the south (y up).
struct SemanticGrid {
  std::int64_t stamp_ns = 0;
  double cell_m = 0.5;
  int first_column = 0, first_row = 0;  ///< the south-west corner is at (first_column, first_row) * cell_m
  int width = 0, height = 0;
  std::vector<float> probability;          ///< NaN where nothing was observed
  std::vector<std::int32_t> images;        ///< with evidence on the cell
  std::vector<std::int32_t> class_images;  ///< of them those with evidence for the class
  std::vector<std::int32_t> class_latest;  ///< the number of the latest that shows the class there, from 1 on; 0: none
  std::int32_t latest = 0;                 ///< the number of the latest image of all
  std::vector<float> ground_world_m;       ///< height of the cell's middle, less the error of the elevation; or NaN

  std::size_t index(int column, int row) const {
    return static_cast<std::size_t>(row) * static_cast<std::size_t>(width) + static_cast<std::size_t>(column);
  }
  Eigen::Vector2d middle_world_m(int column, int row) const {
    return {(first_column + column + 0.5) * cell_m, (first_row + row + 0.5) * cell_m};
  }
};

/// Cells that touch by an edge or a corner and are of the class.
struct GridCluster {
  Eigen::Vector2d p_world_m = Eigen::Vector2d::Zero();  ///< mean of the cells' middles, weighted by their probability
  double ground_world_m = 0.0;                          ///< of that place
  double area_m2 = 0.0;
  double probability = 0.0;  ///< mean of the cells
  int images = 0;            ///< with evidence for the class, of the cell that has most
  /// The first and the last, by number, of the separate things of the class that the latest image shows on its cells;
  /// 0: none.
  int first_shown = 0, last_shown = 0;
};

/// Of the cells whose probability is above a half. Overwrites `clusters`.
void find_clusters(const SemanticGrid& grid, std::vector<GridCluster>& clusters);

/// Whether the latest image shows something on each of two clusters, and not one thing on both.
bool shown_apart(const GridCluster& one, const GridCluster& other);

/// Something of the class: a cluster that is followed from image to image.
struct GridTarget {
  std::uint64_t id = 0;                                     ///< never used twice
  Eigen::Vector3d p_world_m = Eigen::Vector3d::Zero();      ///< the centroid, on the ground
  Eigen::Matrix2d covariance_m2 = Eigen::Matrix2d::Zero();  ///< of x and y
  double area_m2 = 0.0;
  double probability = 0.0;  ///< mean of its cells
};

/// Of the error of a camera's place in x, y, z (m) and of its attitude about the world's axes (rad).
using CameraPoseCovariance = Eigen::Matrix<double, 6, 6>;

struct GridTargets {
  std::int64_t stamp_ns = 0;
  std::vector<GridTarget> targets;  ///< by id
};

}  // namespace situation_awareness

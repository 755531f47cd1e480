// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstddef>
#include <vector>

#include <Eigen/Core>

#include "situation_awareness/cloud/cloud.hpp"

namespace situation_awareness {

Eigen::Vector3d position_sensor(const CloudPoint& point);

/// The directions of those measurements of a structured cloud that have no return, from the returns beside them.
///
/// A sensor of rows and columns looks along a grid: one coordinate of the direction is the same all along a column, the
/// other along a row. Which coordinates these are tells a spinning scanner (azimuth and elevation) from a camera (the
/// two of its image); those that scatter least within columns and rows are the sensor's. A row or column without any
/// return lies on the line between its neighbours. Where all scatter, the rows and columns are none of a grid.
class CloudDirections {
 public:
  void learn(const Cloud& cloud);

  /// False for an unstructured cloud, one without missing returns, and one with too few returns to tell.
  bool known() const { return !columns_.empty(); }

  /// Along the measurement with this place in Cloud::points, in the sensor's frame; not of unit length.
  Eigen::Vector3d at(std::size_t place) const;

 private:
  enum class Grid { kRingIsRow, kRingIsColumn, kCameraAlongX, kCameraAlongZ };

  /// One coordinate for each row, or each column, as the mean of its returns.
  class Coordinates {
   public:
    void reset(std::size_t size, bool is_angle);
    void add(std::size_t i, double value);
    /// Sum of squares about the means.
    double scatter() const;
    /// The means, and what is between and beside them on straight lines; empty if fewer than two are known.
    void interpolate(std::vector<double>& values) const;

   private:
    struct Sum {
      double first = 0.0;  ///< about which the others are summed
      double offsets = 0.0;
      int count = 0;
    };
    bool is_angle_ = false;
    double squares_ = 0.0;
    std::vector<Sum> sums_;
  };

  static bool sees(Grid grid, const Eigen::Vector3d& p_sensor);
  static Eigen::Vector2d column_and_row(Grid grid, const Eigen::Vector3d& p_sensor);
  /// Of at most so many rows and columns, evenly. Returns their number; 0 if the grid cannot be that of the cloud.
  std::size_t add_returns(const Cloud& cloud, Grid grid, std::size_t most);

  Grid grid_ = Grid::kRingIsRow;
  Coordinates of_columns_, of_rows_;
  std::vector<double> columns_, rows_;
};

}  // namespace situation_awareness

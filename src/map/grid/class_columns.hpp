// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstdint>
#include <vector>

#include <Eigen/Core>

#include "label_reader.hpp"
#include "situation_awareness/map/grid/grid_map.hpp"

namespace situation_awareness {

/// What an image shows of the columns above a cell that are as high as the class, by each error of the elevation: they
/// begin at several heights above each other.
class ClassColumns {
 public:
  /// The extremes over what is known of a column.
  struct Extremes {
    float least, greatest;  ///< label
    float soft_least;       ///< mean over 3 x 3 pixels
    int known;              ///< heights
  };

  ClassColumns(double class_height_m, double offset_step_m);

  /// The error of the elevation at a place of those that are tried.
  double offset_m(int offset) const { return (offset - GridMap::kOffsets / 2) * steps_per_offset_ * height_step_m_; }
  /// The number of heights of a column.
  int heights() const { return heights_; }

  /// Reads the labels above a foot; false if none is known. As LabelReader::read_column.
  bool read(const LabelReader& reader, const Eigen::Vector3d& foot, const Eigen::Vector3d& up);
  /// Finds the extremes of the columns that were read, but for what is hidden below a height above their feet.
  void find_extremes(double hidden_below_m);
  Extremes extremes(int offset) const {
    const auto first = static_cast<std::size_t>(offset * steps_per_offset_);
    return {least_[first], greatest_[first], soft_least_[first], known_[first]};
  }

 private:
  int heights_, steps_per_offset_;
  double height_step_m_;
  std::vector<float> sharp_, soft_;                   ///< from the lowest foot on
  std::vector<float> least_, greatest_, soft_least_;  ///< of the columns that begin there
  std::vector<std::int32_t> known_;
};

}  // namespace situation_awareness

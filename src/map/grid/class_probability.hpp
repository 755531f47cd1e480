// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstddef>
#include <cstdint>
#include <vector>

#include "class_columns.hpp"
#include "grid_tiles.hpp"
#include "situation_awareness/map/grid/grid.hpp"

namespace situation_awareness {

/// Tells from the evidence of the cells of a grid how probable the class is on each of them.
class ClassProbability {
 public:
  static constexpr int kEnough = 6;  ///< images that show a cell: more take no more of them to believe the class

  /// `images`: of the whole grid. `believed`: the error of the elevation, by its number.
  ClassProbability(const GridTiles& tiles, const ClassColumns& columns, double cell_m, std::int32_t images,
                   int believed)
      : tiles_(tiles), columns_(columns), cell_m_(cell_m), images_(images), believed_(believed) {}

  /// Writes all cells of a grid whose extent was set; with `only_class` only those of tiles in which an image showed
  /// something of the class.
  void read(SemanticGrid& grid, bool only_class) const;

 private:
  void read_tile(const Place& key, const Tile& tile, SemanticGrid& grid, std::vector<float>& soft,
                 std::vector<std::size_t>& of_class) const;
  void judge(SemanticGrid& grid, const std::vector<float>& soft, const std::vector<std::size_t>& of_class) const;
  bool is_of_something_nearer(const SemanticGrid& grid, std::size_t cell) const;
  float enough_images(const Observed& observed, std::size_t cell, const Evidence& evidence) const;

  const GridTiles& tiles_;
  const ClassColumns& columns_;
  double cell_m_;
  std::int32_t images_;
  int believed_;
};

}  // namespace situation_awareness

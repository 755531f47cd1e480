// SPDX-License-Identifier: BSD-3-Clause
#include "situation_awareness/map/grid/grid.hpp"

#include <algorithm>

namespace situation_awareness {
namespace {

struct Cell {
  int column, row;
};

GridCluster cluster_of(const SemanticGrid& grid, const std::vector<Cell>& cells) {
  GridCluster cluster;
  for (const Cell& cell : cells) {
    const std::size_t i = grid.index(cell.column, cell.row);
    const auto probability = static_cast<double>(grid.probability[i]);
    cluster.p_world_m += probability * grid.middle_world_m(cell.column, cell.row);
    cluster.ground_world_m += probability * static_cast<double>(grid.ground_world_m[i]);
    cluster.probability += probability;
    cluster.images = std::max(cluster.images, static_cast<int>(grid.class_images[i]));
    cluster.is_seen |= grid.class_latest[i] == grid.latest;
  }
  cluster.p_world_m /= cluster.probability;
  cluster.ground_world_m /= cluster.probability;
  cluster.area_m2 = static_cast<double>(cells.size()) * grid.cell_m * grid.cell_m;
  cluster.probability /= static_cast<double>(cells.size());
  return cluster;
}

}  // namespace

void find_clusters(const SemanticGrid& grid, std::vector<GridCluster>& clusters) {
  clusters.clear();
  std::vector<bool> is_taken(grid.probability.size(), false);
  std::vector<Cell> cells;
  const auto take = [&](int column, int row) {
    if (column < 0 || row < 0 || column >= grid.width || row >= grid.height) return;
    const std::size_t i = grid.index(column, row);
    if (is_taken[i] || !(grid.probability[i] > 0.5F)) return;
    is_taken[i] = true;
    cells.push_back({column, row});
  };
  for (int row = 0; row < grid.height; ++row) {
    for (int column = 0; column < grid.width; ++column) {
      cells.clear();
      take(column, row);
      for (std::size_t next = 0; next < cells.size(); ++next) {
        const Cell at = cells[next];
        for (int neighbour = 0; neighbour < 9; ++neighbour) {
          take(at.column + neighbour % 3 - 1, at.row + neighbour / 3 - 1);
        }
      }
      if (!cells.empty()) clusters.push_back(cluster_of(grid, cells));
    }
  }
}

}  // namespace situation_awareness

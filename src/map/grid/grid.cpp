// SPDX-License-Identifier: BSD-3-Clause
#include "situation_awareness/map/grid/grid.hpp"

#include <algorithm>

namespace situation_awareness {
namespace {

struct Cell {
  int column, row;
};

/// Calls `on_component` with each set of cells that are in and touch by an edge or a corner.
template <class IsIn, class OnComponent>
void for_each_component(const SemanticGrid& grid, const IsIn& is_in, const OnComponent& on_component) {
  std::vector<bool> is_taken(grid.probability.size(), false);
  std::vector<Cell> cells;
  const auto take = [&](int column, int row) {
    if (column < 0 || row < 0 || column >= grid.width || row >= grid.height) return;
    const std::size_t i = grid.index(column, row);
    if (is_taken[i] || !is_in(i)) return;
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
      if (!cells.empty()) on_component(cells);
    }
  }
}

/// Of each cell the number of what the latest image shows there, from 1 on; 0: nothing of the class.
std::vector<int> shown_by_latest(const SemanticGrid& grid) {
  std::vector<int> shown(grid.probability.size(), 0);
  int number = 0;
  for_each_component(
      grid, [&](std::size_t i) { return grid.class_latest[i] == grid.latest && grid.latest > 0; },
      [&](const std::vector<Cell>& cells) {
        ++number;
        for (const Cell& cell : cells) shown[grid.index(cell.column, cell.row)] = number;
      });
  return shown;
}

GridCluster cluster_of(const SemanticGrid& grid, const std::vector<int>& shown, const std::vector<Cell>& cells) {
  GridCluster cluster;
  for (const Cell& cell : cells) {
    const std::size_t i = grid.index(cell.column, cell.row);
    const auto probability = static_cast<double>(grid.probability[i]);
    cluster.p_world_m += probability * grid.middle_world_m(cell.column, cell.row);
    cluster.ground_world_m += probability * static_cast<double>(grid.ground_world_m[i]);
    cluster.probability += probability;
    cluster.images = std::max(cluster.images, static_cast<int>(grid.class_images[i]));
    if (shown[i] == 0) continue;
    cluster.first_shown = cluster.first_shown == 0 ? shown[i] : std::min(cluster.first_shown, shown[i]);
    cluster.last_shown = std::max(cluster.last_shown, shown[i]);
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
  const std::vector<int> shown = shown_by_latest(grid);
  for_each_component(
      grid, [&](std::size_t i) { return grid.probability[i] > 0.5F; },
      [&](const std::vector<Cell>& cells) { clusters.push_back(cluster_of(grid, shown, cells)); });
}

bool shown_apart(const GridCluster& one, const GridCluster& other) {
  if (one.first_shown == 0 || other.first_shown == 0) return false;
  return std::min(one.first_shown, other.first_shown) != std::max(one.last_shown, other.last_shown);
}

}  // namespace situation_awareness

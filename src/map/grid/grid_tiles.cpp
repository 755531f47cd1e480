// SPDX-License-Identifier: BSD-3-Clause
#include "grid_tiles.hpp"

#include <cmath>
#include <limits>

namespace situation_awareness {
namespace {

/// The tile of a cell of the grid, and the cell in it.
std::pair<Place, std::size_t> place_of(int column, int row) {
  const auto tile_of = [](int i) { return i >= 0 ? i / kTileCells : (i + 1) / kTileCells - 1; };
  const Place key{tile_of(column), tile_of(row)};
  return {key, static_cast<std::size_t>((row - key.row * kTileCells) * kTileCells + column - key.column * kTileCells)};
}

/// The place in a grid of a cell of a tile.
Place place_in(const SemanticGrid& grid, const Place& key, std::size_t cell) {
  return {key.column * kTileCells + static_cast<int>(cell) % kTileCells - grid.first_column,
          key.row * kTileCells + static_cast<int>(cell) / kTileCells - grid.first_row};
}

}  // namespace

Tile& GridTiles::known(Place key, std::map<Place, Tile>::iterator& next) {
  const std::size_t before = tiles_.size();
  const auto found = tiles_.try_emplace(next, key);
  if (tiles_.size() > before) find_ground(key, found->second);
  next = std::next(found);
  return found->second;
}

void GridTiles::find_ground(Place key, Tile& tile) const {
  tile.low_m = std::numeric_limits<double>::infinity();
  tile.high_m = -tile.low_m;
  for (int r = 0; r < kTileCells; ++r) {
    for (int c = 0; c < kTileCells; ++c) {
      const double x_m = (key.column * kTileCells + c + 0.5) * cell_m_;
      const double y_m = (key.row * kTileCells + r + 0.5) * cell_m_;
      const double ground_m = ground_->at(x_m, y_m);
      const auto i = static_cast<std::size_t>(r * kTileCells + c);
      tile.ground_world_m[i] = static_cast<float>(ground_m);
      if (std::isnan(ground_m)) continue;
      tile.low_m = std::min(tile.low_m, ground_m);
      tile.high_m = std::max(tile.high_m, ground_m);
    }
  }
}

std::pair<const Tile*, std::size_t> GridTiles::find_cell(int column, int row) const {
  const auto [key, cell] = place_of(column, row);
  const auto found = tiles_.find(key);
  if (found == tiles_.end() || !has_evidence(found->second)) return {nullptr, 0};
  return {&found->second, cell};
}

bool GridTiles::is_far(const Place& key, const Eigen::Vector2d& p_world_m, double distance_m) const {
  const double edge_m = kTileCells * cell_m_;
  const Eigen::Vector2d middle_m = Eigen::Vector2d(key.column + 0.5, key.row + 0.5) * edge_m;
  return (middle_m - p_world_m).cwiseAbs().maxCoeff() > distance_m + 0.5 * edge_m;
}

void GridTiles::keep_around(const Eigen::Vector2d& p_world_m, double distance_m) {
  for (auto it = tiles_.begin(); it != tiles_.end();) {
    it = is_far(it->first, p_world_m, distance_m) ? tiles_.erase(it) : std::next(it);
  }
  for (auto it = settled_.begin(); it != settled_.end();) {
    it = is_far(it->first, p_world_m, distance_m) ? settled_.erase(it) : std::next(it);
  }
}

void GridTiles::settle_beyond(const Eigen::Vector2d& p_world_m, double distance_m, const SemanticGrid& judged) {
  for (auto it = tiles_.begin(); it != tiles_.end();) {
    if (!is_far(it->first, p_world_m, distance_m)) {
      ++it;
      continue;
    }
    if (is_observed(it->second)) settle(it->first, *it->second.observed, judged);
    it = tiles_.erase(it);
  }
}

bool GridTiles::is_settled(const Eigen::Vector2d& p_world_m, int images) const {
  const Eigen::Vector2d at = p_world_m / cell_m_;
  if (!(at.cwiseAbs().maxCoeff() < kFarthest_m / cell_m_)) return false;
  const auto [key, cell] = place_of(static_cast<int>(std::floor(at.x())), static_cast<int>(std::floor(at.y())));
  const auto settled = settled_.find(key);
  if (settled == settled_.end() || settled->second.images[cell] == 0) return false;
  const auto tile = tiles_.find(key);
  return tile == tiles_.end() || !tile->second.observed || tile->second.observed->images[cell] < images;
}

/// What was settled before stays where no image has shown a cell since.
void GridTiles::settle(const Place& key, const Observed& observed, const SemanticGrid& judged) {
  SettledTile& settled = settled_[key];
  std::vector<SettledTile::Cell> of_class;
  for (const SettledTile::Cell& before : settled.of_class) {
    if (observed.images[before.cell] == 0) of_class.push_back(before);
  }
  for (std::size_t cell = 0; cell < kCellsOfTile; ++cell) {
    if (observed.images[cell] == 0) continue;
    settled.images[cell] = static_cast<std::uint16_t>(std::min(observed.images[cell], SettledTile::kMostImages));
    const Evidence* const evidence = observed.find(cell);
    if (evidence == nullptr) continue;
    const auto [column, row] = place_in(judged, key, cell);
    if (column < 0 || row < 0 || column >= judged.width || row >= judged.height) continue;
    of_class.push_back(
        {static_cast<std::uint16_t>(cell), judged.probability[judged.index(column, row)], evidence->class_images});
  }
  of_class.shrink_to_fit();
  settled.of_class = std::move(of_class);
}

void GridTiles::set_extent(bool only_class, SemanticGrid& grid) const {
  int left = std::numeric_limits<int>::max(), right = std::numeric_limits<int>::min(), low = left, high = right;
  const auto extend = [&](const Place& key) {
    left = std::min(left, key.column);
    right = std::max(right, key.column);
    low = std::min(low, key.row);
    high = std::max(high, key.row);
  };
  for (const auto& [key, tile] : tiles_) {
    if (only_class ? has_evidence(tile) : is_observed(tile)) extend(key);
  }
  for (const auto& [key, settled] : settled_) {
    if (!only_class) extend(key);
  }
  const bool is_empty = left > right;
  grid.first_column = is_empty ? 0 : left * kTileCells;
  grid.first_row = is_empty ? 0 : low * kTileCells;
  grid.width = is_empty ? 0 : (right - left + 1) * kTileCells;
  grid.height = is_empty ? 0 : (high - low + 1) * kTileCells;
}

void GridTiles::add_settled(float offset_m, float probability, SemanticGrid& grid) const {
  for (const auto& [key, settled] : settled_) add_settled(key, settled, offset_m, probability, grid);
}

void GridTiles::add_settled(const Place& key, const SettledTile& settled, float offset_m, float probability,
                            SemanticGrid& grid) const {
  const auto found = tiles_.find(key);
  const Observed* const observed = found == tiles_.end() ? nullptr : found->second.observed.get();
  const auto is_shown_since = [&](std::size_t cell) { return observed != nullptr && observed->images[cell] > 0; };
  const auto index_of = [&](std::size_t cell) {
    const Place place = place_in(grid, key, cell);
    return grid.index(place.column, place.row);
  };
  Tile ground;
  if (observed == nullptr) find_ground(key, ground);
  for (std::size_t cell = 0; cell < kCellsOfTile; ++cell) {
    const std::size_t to = index_of(cell);
    if (observed == nullptr) grid.ground_world_m[to] = ground.ground_world_m[cell] + offset_m;
    if (settled.images[cell] == 0 || is_shown_since(cell)) continue;
    grid.images[to] = settled.images[cell];
    grid.probability[to] = probability;
  }
  for (const SettledTile::Cell& cell : settled.of_class) {
    if (is_shown_since(cell.cell)) continue;
    grid.probability[index_of(cell.cell)] = cell.probability;
    grid.class_images[index_of(cell.cell)] = cell.class_images;
  }
}

}  // namespace situation_awareness

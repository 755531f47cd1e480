// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <algorithm>
#include <array>
#include <cstddef>
#include <cstdint>
#include <map>
#include <memory>
#include <utility>
#include <vector>

#include <Eigen/Core>

#include "seen_row.hpp"
#include "situation_awareness/map/grid/elevation.hpp"
#include "situation_awareness/map/grid/grid.hpp"
#include "situation_awareness/map/grid/grid_map.hpp"

namespace situation_awareness {

/// The place of a tile, or of a cell.
struct Place {
  int column = 0, row = 0;
  bool operator<(const Place& other) const { return row != other.row ? row < other.row : column < other.column; }
};

/// The directions from which images look at a cell: unit vectors along their sight lines, each weighted by how much the
/// direction has turned since the image before.
struct Directions {
  Eigen::Vector3f sum = Eigen::Vector3f::Zero();
  float turned = 0.0F;

  void add(const Eigen::Vector3f& along, float turn) {
    sum += turn * along;
    turned += turn;
  }
  void scale(float part) {
    sum *= part;
    turned *= part;
  }
  /// Their variance on the unit sphere.
  float spread() const { return turned > 0.0F ? std::max(0.0F, 1.0F - (sum / turned).squaredNorm()) : 0.0F; }
};

/// The evidence of a cell on which an image showed something of the class, by each error of the elevation: sums over
/// images of their weights, and of their evidence times these.
struct Evidence {
  std::array<float, GridMap::kOffsets> weight{};
  std::array<float, GridMap::kOffsets> sharp_sum{};      ///< by the labels as they are
  std::array<float, GridMap::kOffsets> soft_sum{};       ///< by their means over 3 x 3 pixels
  std::array<Directions, GridMap::kOffsets> class_seen;  ///< from where images show the class
  std::int32_t class_images = 0;                         ///< with evidence for the class, by any offset
  std::int32_t class_latest = 0;                         ///< the number of the latest by the offset that was believed

  float sharp(std::size_t offset) const { return weight[offset] > 0.0F ? sharp_sum[offset] / weight[offset] : 0.0F; }
  float soft(std::size_t offset) const { return weight[offset] > 0.0F ? soft_sum[offset] / weight[offset] : 0.0F; }
};

/// What images tell of the cells of a tile. Numbers of a cell are in arrays, as most cells are treated alike, a row at
/// a time: those that show nothing of the class.
struct Observed {
  using Cells = std::array<float, kCellsOfTile>;

  std::array<std::int32_t, kCellsOfTile> images{};
  Cells seen_x{}, seen_y{}, seen_z{}, turned{};  ///< Directions of all images that show the cell
  Cells latest_x{}, latest_y{}, latest_z{};      ///< the latest of these directions
  Cells nothing_weight{};                        ///< of images, until one shows something of the class on the cell
  std::array<std::uint16_t, kCellsOfTile> number_of{};  ///< from 1 on, of the cell's evidence from then on; 0: none
  std::vector<Evidence> evidence;
  bool is_any_known = false;  ///< an image is evidence on a cell
  bool has_evidence = false;  ///< an image showed something of the class in the tile

  KnownRow row(std::size_t first) {
    return {&seen_x[first],   &seen_y[first],   &seen_z[first],         &turned[first], &latest_x[first],
            &latest_y[first], &latest_z[first], &nothing_weight[first], &images[first]};
  }
  Evidence* find(std::size_t cell) { return number_of[cell] == 0 ? nullptr : &evidence[number_of[cell] - 1U]; }
  const Evidence* find(std::size_t cell) const {
    return number_of[cell] == 0 ? nullptr : &evidence[number_of[cell] - 1U];
  }
  /// Keeps the evidence of a cell on which the class is now seen for each error of the elevation.
  Evidence& begin_evidence(std::size_t cell) {
    is_any_known = has_evidence = true;
    if (Evidence* const known = find(cell)) return *known;
    Evidence& begun = evidence.emplace_back();
    number_of[cell] = static_cast<std::uint16_t>(evidence.size());
    begun.weight.fill(nothing_weight[cell]);
    return begun;
  }
  Directions seen(std::size_t cell) const {
    return {Eigen::Vector3f(seen_x[cell], seen_y[cell], seen_z[cell]), turned[cell]};
  }
};

/// Cells of a square of the world.
struct Tile {
  std::array<float, kCellsOfTile> ground_world_m;  ///< NaN where it is not known
  std::unique_ptr<Observed> observed;              ///< null until an image shows the tile
  double low_m = 0.0, high_m = 0.0;                ///< of its ground; low_m > high_m where none is known
};

/// What the map says of the cells of a tile whose evidence it does not have any more.
struct SettledTile {
  static constexpr int kMostImages = 65535;

  /// A cell of which an image showed the class.
  struct Cell {
    std::uint16_t cell;
    float probability;
    std::int32_t class_images;
  };

  std::array<std::uint16_t, kCellsOfTile> images{};  ///< with evidence, up to kMostImages; 0: not observed
  std::vector<Cell> of_class;                        ///< by cell; all others that were observed are not of the class
};

/// The tiles of a grid, with what images tell of their cells or, further away, what the map says of them.
class GridTiles {
 public:
  static constexpr double kFarthest_m = 1e6;  ///< of a place from the world's origin

  /// `ground`: where things stand.
  GridTiles(double cell_m, std::shared_ptr<const Elevation> ground) : cell_m_(cell_m), ground_(std::move(ground)) {}

  /// Of tiles that are not known yet.
  void set_ground(std::shared_ptr<const Elevation> ground) { ground_ = std::move(ground); }

  static bool is_observed(const Tile& tile) { return tile.observed && tile.observed->is_any_known; }
  static bool has_evidence(const Tile& tile) { return tile.observed && tile.observed->has_evidence; }

  /// Those with a ground, by their places.
  const std::map<Place, Tile>& all() const { return tiles_; }
  std::map<Place, Tile>::iterator begin() { return tiles_.begin(); }
  /// A tile, with its ground. It is looked for at `next` first, which is then set to the one after it: tiles in order
  /// take no search.
  Tile& known(Place key, std::map<Place, Tile>::iterator& next);
  /// A cell of the grid and its tile; null where that has no evidence.
  std::pair<const Tile*, std::size_t> find_cell(int column, int row) const;

  /// Forgets what is farther away.
  void keep_around(const Eigen::Vector2d& p_world_m, double distance_m);
  /// Settles what is farther away as it was judged.
  void settle_beyond(const Eigen::Vector2d& p_world_m, double distance_m, const SemanticGrid& judged);
  /// Whether a place was settled, and fewer than so many images have shown it since.
  bool is_settled(const Eigen::Vector2d& p_world_m, int images) const;

  /// Makes a grid, of which only the extent is written, as large as all tiles that were observed, or only those with
  /// evidence.
  void set_extent(bool only_class, SemanticGrid& grid) const;
  /// Writes the cells that were settled and that no image has shown since. `probability`: of those that no image showed
  /// as of the class.
  void add_settled(float offset_m, float probability, SemanticGrid& grid) const;

 private:
  bool is_far(const Place& key, const Eigen::Vector2d& p_world_m, double distance_m) const;
  void find_ground(Place key, Tile& tile) const;
  void settle(const Place& key, const Observed& observed, const SemanticGrid& judged);
  void add_settled(const Place& key, const SettledTile& settled, float offset_m, float probability,
                   SemanticGrid& grid) const;

  double cell_m_;
  std::shared_ptr<const Elevation> ground_;
  std::map<Place, Tile> tiles_;
  std::map<Place, SettledTile> settled_;  ///< whose evidence was freed; those that images show again are in both
};

}  // namespace situation_awareness

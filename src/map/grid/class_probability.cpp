// SPDX-License-Identifier: BSD-3-Clause
#include "class_probability.hpp"

#include <algorithm>
#include <cmath>
#include <limits>

namespace situation_awareness {
namespace {

// Where no source is named, none is recorded; the sensitivity of these was not measured.

/// Evidence of which half makes a cell of the class, however weak all is around it.
constexpr double kLeastMean = 0.5;
constexpr double kSteepness = 8.0;  ///< of the probability by the mean of evidence
constexpr int kFew = 4;             ///< images of the grid, from which one alone is not enough
/// Parts of the directions that a cell was seen from, and of their spread, from which the class is shown.
constexpr float kClassTurned = 0.2F, kClassSpread = 0.7F, kLeastSpread = 1e-4F;
constexpr float kParallax = 2.0F;   ///< of the directions' turn, that tells near from far
constexpr float kBetter = 1.3F;     ///< evidence on something nearer, as a part of that on the cell
constexpr double kSearch_m = 40.0;  ///< for something nearer
constexpr double kAround_m = 2.0;   ///< in which a cell is compared with others
constexpr float kNoisy = 0.9F;      ///< part of the soft means that the sharp ones reach where labels are not noisy

/// Returns 1 where images from enough of the directions that the cell was seen from show the class, or from both ends
/// of them, and less elsewhere: what is above the ground shows before the cell from a few directions side by side.
float enough_directions(const Observed& observed, std::size_t cell, const Evidence& evidence, std::size_t offset) {
  const Directions& of_class = evidence.class_seen[offset];
  const Directions all = observed.seen(cell);
  if (of_class.turned <= 0.0F) return 0.0F;
  return std::min(1.0F, std::max(of_class.turned / (kClassTurned * all.turned),
                                 of_class.spread() / (kClassSpread * std::max(all.spread(), kLeastSpread))));
}

double probability_by(double part) { return 1.0 / (1.0 + std::exp(-kSteepness * (part - 0.5))); }

}  // namespace

void ClassProbability::read(SemanticGrid& grid, bool only_class) const {
  const std::size_t cells = static_cast<std::size_t>(grid.width) * static_cast<std::size_t>(grid.height);
  grid.probability.assign(cells, std::numeric_limits<float>::quiet_NaN());
  grid.ground_world_m.assign(cells, std::numeric_limits<float>::quiet_NaN());
  grid.images.assign(cells, 0);
  grid.class_images.assign(cells, 0);
  grid.class_latest.assign(cells, 0);
  std::vector<std::size_t> of_class;
  std::vector<float> soft(cells, 0.0F);
  for (const auto& [key, tile] : tiles_.all()) {
    if (only_class ? GridTiles::has_evidence(tile) : GridTiles::is_observed(tile)) {
      read_tile(key, tile, grid, soft, of_class);
    }
  }
  judge(grid, soft, of_class);
  if (only_class) return;
  tiles_.add_settled(static_cast<float>(columns_.offset_m(believed_)), static_cast<float>(probability_by(0.0)), grid);
}

/// Reads the means of evidence, of both kinds, and finds the cells where either may be of the class.
void ClassProbability::read_tile(const Place& key, const Tile& tile, SemanticGrid& grid, std::vector<float>& soft,
                                 std::vector<std::size_t>& of_class) const {
  const auto believed = static_cast<std::size_t>(believed_);
  for (int r = 0; r < kTileCells; ++r) {
    for (int c = 0; c < kTileCells; ++c) {
      const auto from = static_cast<std::size_t>(r * kTileCells + c);
      const std::size_t to =
          grid.index(key.column * kTileCells - grid.first_column + c, key.row * kTileCells - grid.first_row + r);
      grid.ground_world_m[to] = tile.ground_world_m[from] + static_cast<float>(columns_.offset_m(believed_));
      grid.images[to] = tile.observed->images[from];
      if (grid.images[to] == 0) continue;
      grid.probability[to] = 0.0F;
      const Evidence* const evidence = tile.observed->find(from);
      if (evidence == nullptr) continue;
      grid.class_images[to] = evidence->class_images;
      grid.class_latest[to] = evidence->class_latest;
      const float sharp = evidence->sharp(believed), softer = evidence->soft(believed);
      if (sharp <= 0.01F && softer <= 0.01F) continue;
      const float enough =
          enough_images(*tile.observed, from, *evidence) * enough_directions(*tile.observed, from, *evidence, believed);
      grid.probability[to] = sharp * enough * enough;
      soft[to] = softer * enough * enough;
      if (soft[to] > 0.01F || grid.probability[to] > 0.01F) of_class.push_back(to);
    }
  }
}

/// Makes probabilities of means of evidence: something of the class is where the mean is at least half of what it is
/// around. Labels that miss the class in a part of the images, or a pose with noise, lower both. Where labels are so
/// noisy that columns that are of the class from foot to top are rare, it is the soft means.
void ClassProbability::judge(SemanticGrid& grid, const std::vector<float>& soft,
                             const std::vector<std::size_t>& of_class) const {
  const std::vector<float> sharp = grid.probability;
  const int reach = std::max(1, static_cast<int>(std::lround(kAround_m / cell_m_)));
  const auto greatest_around = [&](const std::vector<float>& values, std::size_t cell) {
    const int column = static_cast<int>(cell) % grid.width, row = static_cast<int>(cell) / grid.width;
    float greatest = 0.0F;
    for (int r = std::max(row - reach, 0); r <= std::min(row + reach, grid.height - 1); ++r) {
      for (int c = std::max(column - reach, 0); c <= std::min(column + reach, grid.width - 1); ++c) {
        const float value = values[grid.index(c, r)];
        if (value > greatest) greatest = value;  // not NaN
      }
    }
    return greatest;
  };
  for (float& probability : grid.probability) {
    if (!std::isnan(probability)) probability = static_cast<float>(probability_by(0.0));
  }
  double sharp_sum = 0.0, soft_sum = 0.0;
  std::vector<float> greatest(of_class.size());
  for (std::size_t i = 0; i < of_class.size(); ++i) {
    const std::size_t cell = of_class[i];
    greatest[i] = greatest_around(soft, cell);
    if (soft[cell] < std::max(0.8F * greatest[i], 0.25F)) continue;
    sharp_sum += static_cast<double>(sharp[cell]);
    soft_sum += static_cast<double>(soft[cell]);
  }
  const bool is_noisy = sharp_sum < kNoisy * soft_sum;
  const std::vector<float>& mean = is_noisy ? soft : sharp;
  for (std::size_t i = 0; i < of_class.size(); ++i) {
    const std::size_t cell = of_class[i];
    if (!is_noisy) greatest[i] = greatest_around(sharp, cell);
    const float around = std::max(greatest[i], static_cast<float>(kLeastMean));
    const float part = mean[cell] / around;
    if (part > 0.5F && is_of_something_nearer(grid, cell)) continue;
    grid.probability[cell] = static_cast<float>(probability_by(static_cast<double>(part)));
  }
}

/// Returns whether the images that show the class on a cell agree better on something nearer to them that their sight
/// lines to the cell pass through: on the ground, or above it as far as the errors of the elevation reach.
bool ClassProbability::is_of_something_nearer(const SemanticGrid& grid, std::size_t cell) const {
  const int column = grid.first_column + static_cast<int>(cell) % grid.width;
  const int row = grid.first_row + static_cast<int>(cell) / grid.width;
  const auto [tile, own] = tiles_.find_cell(column, row);
  if (tile == nullptr || tile->observed->turned[own] < kParallax) return false;
  const Evidence* const evidence = tile->observed->find(own);
  if (evidence == nullptr) return false;
  const auto i = static_cast<std::size_t>(believed_);
  const Eigen::Vector3d along = evidence->class_seen[i].sum.cast<double>();
  const double flat = along.head<2>().norm();
  if (!(flat > 0.0) || along.z() >= 0.0) return false;
  const float enough = kBetter * evidence->soft(i);
  for (double m = 2.0 * cell_m_; m < kSearch_m; m += cell_m_) {
    const Eigen::Vector2d at = Eigen::Vector2d(column + 0.5, row + 0.5) - m / (flat * cell_m_) * along.head<2>();
    const auto [near, there] =
        tiles_.find_cell(static_cast<int>(std::floor(at.x())), static_cast<int>(std::floor(at.y())));
    if (near == nullptr) continue;
    const double above_m =
        static_cast<double>(tile->ground_world_m[own] - near->ground_world_m[there]) - m * along.z() / flat;
    const int offset =
        believed_ + static_cast<int>(std::lround(above_m / columns_.offset_m(GridMap::kOffsets / 2 + 1)));
    if (offset >= GridMap::kOffsets) return false;
    if (offset < believed_) continue;
    const Evidence* const nearer = near->observed->find(there);
    if (nearer != nullptr && nearer->soft(static_cast<std::size_t>(offset)) > enough) return true;
  }
  return false;
}

/// Returns 1 where as many images show the class as it takes to believe them. Less is returned elsewhere: one of the
/// many that a map has is not enough even where no other shows the cell.
float ClassProbability::enough_images(const Observed& observed, std::size_t cell, const Evidence& evidence) const {
  const int images = std::clamp(observed.images[cell], std::min(images_, kFew), kEnough);
  return std::min(1.0F, static_cast<float>(evidence.class_images) / static_cast<float>(images));
}

}  // namespace situation_awareness

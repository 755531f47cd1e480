// SPDX-License-Identifier: BSD-3-Clause
#include "situation_awareness/map/polygons/near_elements.hpp"

#include <algorithm>
#include <array>
#include <cmath>

#include "situation_awareness/common/usual_room.hpp"

namespace situation_awareness {
namespace {

/// Rows and columns are counted from here, so that neither is negative.
constexpr double kMiddle = 2147483648.0;
constexpr std::uint64_t kRow = std::uint64_t{1} << 32U;
/// Neighbours of an element that there is room for: those of a wall.
constexpr std::size_t kUsualNeighbours = 8;

}  // namespace

void NearElements::find(const Surfels& surfels, const std::vector<Surfels::Index>& elements, double radius_m) {
  entries_.clear();
  if (entries_.capacity() < elements.size()) entries_.reserve(elements.size() + elements.size() / 2 + kUsualRoom);
  const double cells_1_m = 1.0 / radius_m;
  for (const Surfels::Index index : elements) {
    const Eigen::Vector2d& p_m = surfels[index].p_world_m;
    const auto row = static_cast<std::uint64_t>(std::floor(p_m.y() * cells_1_m) + kMiddle);
    const auto column = static_cast<std::uint64_t>(std::floor(p_m.x() * cells_1_m) + kMiddle);
    entries_.push_back({row * kRow + column, index, p_m.x(), p_m.y()});
  }
  std::sort(entries_.begin(), entries_.end(),
            [](const Entry& a, const Entry& b) { return a.cell != b.cell ? a.cell < b.cell : a.index < b.index; });
  assign_with_room(of_element_, static_cast<std::size_t>(surfels.end()), Range{});
  list_.clear();
  if (list_.capacity() < kUsualNeighbours * elements.size()) {
    list_.reserve(2 * kUsualNeighbours * elements.size() + kUsualRoom);
  }

  // A cell's neighbours are a run of each of three rows, which moves on with the cell.
  std::array<Range, 3> runs;
  for (std::size_t first = 0; first < entries_.size();) {
    const std::uint64_t cell = entries_[first].cell;
    std::size_t end = first;
    while (end < entries_.size() && entries_[end].cell == cell) ++end;
    for (std::size_t r = 0; r < runs.size(); ++r) {
      const std::uint64_t middle = cell + r * kRow - kRow;
      Range& run = runs[r];
      while (run.first < entries_.size() && entries_[run.first].cell < middle - 1) ++run.first;
      run.end = std::max(run.end, run.first);
      while (run.end < entries_.size() && entries_[run.end].cell <= middle + 1) ++run.end;
    }
    for (std::size_t k = first; k < end; ++k) {
      const Entry& own = entries_[k];
      Range& range = of_element_[static_cast<std::size_t>(own.index)];
      range.first = list_.size();
      for (const Range& run : runs) {
        for (std::size_t j = run.first; j < run.end; ++j) {
          const Entry& other = entries_[j];
          const double dx_m = other.x_m - own.x_m, dy_m = other.y_m - own.y_m;
          if (dx_m * dx_m + dy_m * dy_m <= radius_m * radius_m && j != k) list_.push_back(other.index);
        }
      }
      range.end = list_.size();
    }
    first = end;
  }
}

}  // namespace situation_awareness

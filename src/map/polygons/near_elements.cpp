// SPDX-License-Identifier: BSD-3-Clause
#include "situation_awareness/map/polygons/near_elements.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <utility>

#include "situation_awareness/common/usual_room.hpp"

namespace situation_awareness {
namespace {

/// Rows and columns are counted from here, so that neither is negative.
constexpr double kMiddle = 2147483648.0;
constexpr unsigned kRowBits = 32;
constexpr std::uint64_t kRow = std::uint64_t{1} << kRowBits;
/// Bits of a digit by which cells are sorted: those of a map of some 100 m.
constexpr unsigned kDigitBits = 11;
/// Neighbours of an element that there is room for: those of a wall.
constexpr std::size_t kUsualNeighbours = 8;

}  // namespace

/// By the rows or the columns of their cells, from its lowest bit on. Digit by digit, each time in the order of those
/// before (radix sort).
void NearElements::sort_by(unsigned lowest_bit) {
  const auto number_of = [&](const Entry& entry) { return (entry.cell >> lowest_bit) & (kRow - 1U); };
  std::uint64_t least = kRow, most = 0;
  for (const Entry& entry : entries_) {
    least = std::min(least, number_of(entry));
    most = std::max(most, number_of(entry));
  }
  for (unsigned shift = 0; least < most && (most - least) >> shift != 0; shift += kDigitBits) {
    const auto digit_of = [&](const Entry& entry) {
      return ((number_of(entry) - least) >> shift) & ((std::uint64_t{1} << kDigitBits) - 1U);
    };
    places_.assign((std::size_t{1} << kDigitBits) + 1, 0);
    for (const Entry& entry : entries_) ++places_[digit_of(entry) + 1];
    for (std::size_t digit = 1; digit < places_.size(); ++digit) places_[digit] += places_[digit - 1];
    sorted_.resize(entries_.size());
    for (const Entry& entry : entries_) sorted_[places_[digit_of(entry)]++] = entry;
    std::swap(entries_, sorted_);
  }
}

void NearElements::find(const std::vector<LinkElement>& list, const std::vector<Index>& elements, double radius_m) {
  for (std::vector<Entry>* entries : {&entries_, &sorted_}) {
    if (entries->capacity() < elements.size()) entries->reserve(elements.size() + elements.size() / 2 + kUsualRoom);
  }
  entries_.clear();
  const double cells_1_m = 1.0 / radius_m;
  for (const Index index : elements) {
    const Eigen::Vector2d& p_m = list[static_cast<std::size_t>(index)].p_world_m;
    const auto row = static_cast<std::uint64_t>(std::floor(p_m.y() * cells_1_m) + kMiddle);
    const auto column = static_cast<std::uint64_t>(std::floor(p_m.x() * cells_1_m) + kMiddle);
    entries_.push_back({row * kRow + column, p_m.x(), p_m.y(), index});
  }
  sort_by(0);
  sort_by(kRowBits);
  assign_with_room(of_element_, list.size(), Range{});
  if (near_.size() < kUsualNeighbours * elements.size()) near_.resize(2 * kUsualNeighbours * elements.size());
  std::size_t count = 0;

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
    std::size_t most = 0;
    for (const Range& run : runs) most += run.end - run.first;
    for (std::size_t k = first; k < end; ++k) {
      const Entry& own = entries_[k];
      Range& range = of_element_[static_cast<std::size_t>(own.index)];
      range.first = count;
      if (near_.size() < count + most) near_.resize(2 * (count + most));
      for (const Range& run : runs) {
        for (std::size_t j = run.first; j < run.end; ++j) {
          const Entry& other = entries_[j];
          const double dx_m = other.x_m - own.x_m, dy_m = other.y_m - own.y_m;
          const bool is_near = dx_m * dx_m + dy_m * dy_m <= radius_m * radius_m;
          near_[count] = other.index;  // overwritten if it is not: no branch that is hard to predict
          count += static_cast<std::size_t>(is_near & (j != k));
        }
      }
      range.end = count;
    }
    first = end;
  }
}

}  // namespace situation_awareness

// SPDX-License-Identifier: BSD-3-Clause
#include "situation_awareness/path/seen_ground.hpp"

#include <algorithm>
#include <cmath>

namespace situation_awareness {
namespace {

constexpr double kLeastCell_m = 0.05;
constexpr double kMostCells = 30.0;  // along the radius, so that the cost is bounded for a vehicle of any size

}  // namespace

SeenGround::SeenGround(double radius_m)
    : radius_m_(radius_m),
      cell_m_(std::max(kLeastCell_m, radius_m / kMostCells)),
      side_(2 * (static_cast<std::size_t>(std::ceil(radius_m / cell_m_)) + 1) + 1),
      cells_(side_ * side_) {}

void SeenGround::clear() { std::fill(cells_.begin(), cells_.end(), Cell()); }

std::int64_t SeenGround::index_of(double p_m) const { return std::llround(p_m / cell_m_); }

}  // namespace situation_awareness

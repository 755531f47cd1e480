// SPDX-License-Identifier: BSD-3-Clause
#include "cloud_directions.hpp"

#include <algorithm>
#include <cmath>

#include "situation_awareness/geometry/angles.hpp"

namespace situation_awareness {
namespace {

constexpr std::size_t kSample = 64;       ///< rows and columns that tell the kind of sensor
constexpr double kMaxScatter_rad = 0.01;  ///< RMS; of rows and columns that are no grid it is a part of the view

}  // namespace

Eigen::Vector3d position_sensor(const CloudPoint& point) {
  return Eigen::Vector3f(point.x_m, point.y_m, point.z_m).cast<double>();
}

void CloudDirections::Coordinates::reset(std::size_t size, bool is_angle) {
  is_angle_ = is_angle;
  squares_ = 0.0;
  sums_.assign(size, Sum{});
}

void CloudDirections::Coordinates::add(std::size_t i, double value) {
  Sum& sum = sums_[i];
  if (sum.count++ == 0) sum.first = value;
  const double offset = is_angle_ ? wrap_to_pi(value - sum.first) : value - sum.first;
  sum.offsets += offset;
  squares_ += offset * offset;
}

double CloudDirections::Coordinates::scatter() const {
  double of_means = 0.0;
  for (const Sum& sum : sums_) {
    if (sum.count > 0) of_means += sum.offsets * sum.offsets / sum.count;
  }
  return squares_ - of_means;
}

void CloudDirections::Coordinates::interpolate(std::vector<double>& values) const {
  const std::size_t n = sums_.size();
  values.assign(n, 0.0);
  std::size_t known = 0, before = 0, last = 0;  // how many; the last two of them
  const auto draw_line = [&](std::size_t from, std::size_t to) {
    const double slope = (values[last] - values[before]) / static_cast<double>(last - before);
    for (std::size_t i = from; i < to; ++i) {
      values[i] = values[before] + slope * (static_cast<double>(i) - static_cast<double>(before));
    }
  };
  for (std::size_t i = 0; i < n; ++i) {
    if (sums_[i].count == 0) continue;
    values[i] = sums_[i].first + sums_[i].offsets / sums_[i].count;
    if (is_angle_ && known > 0) values[i] = values[last] + wrap_to_pi(values[i] - values[last]);
    before = last;
    last = i;
    if (++known < 2) continue;
    draw_line(known == 2 ? 0 : before + 1, last);
  }
  if (known < 2) {
    values.clear();
  } else {
    draw_line(last + 1, n);
  }
}

void CloudDirections::learn(const Cloud& cloud) {
  columns_.clear();
  rows_.clear();
  if (cloud.rows < 2 || cloud.columns < 2) return;
  if (std::all_of(cloud.points.begin(), cloud.points.end(), is_return)) return;
  double least = kMaxScatter_rad * kMaxScatter_rad;
  bool found = false;
  for (const Grid grid : {Grid::kRingIsRow, Grid::kRingIsColumn, Grid::kCameraAlongX, Grid::kCameraAlongZ}) {
    const std::size_t returns = add_returns(cloud, grid, kSample);
    if (returns == 0) continue;
    const double scatter = (of_columns_.scatter() + of_rows_.scatter()) / static_cast<double>(returns);
    if (scatter >= least) continue;
    least = scatter;
    grid_ = grid;
    found = true;
  }
  if (!found || add_returns(cloud, grid_, cloud.points.size()) == 0) return;
  of_columns_.interpolate(columns_);
  of_rows_.interpolate(rows_);
  if (rows_.empty()) columns_.clear();
}

std::size_t CloudDirections::add_returns(const Cloud& cloud, Grid grid, std::size_t most) {
  of_columns_.reset(cloud.columns, grid == Grid::kRingIsRow);
  of_rows_.reset(cloud.rows, grid == Grid::kRingIsColumn);
  const std::size_t row_step = (cloud.rows + most - 1) / most;
  const std::size_t column_step = (cloud.columns + most - 1) / most;
  std::size_t returns = 0;
  for (std::size_t row = 0; row < cloud.rows; row += row_step) {
    for (std::size_t column = 0; column < cloud.columns; column += column_step) {
      const CloudPoint& point = cloud.points[row * cloud.columns + column];
      if (!is_return(point)) continue;
      const Eigen::Vector3d p_sensor = position_sensor(point);
      if (!sees(grid, p_sensor)) return 0;
      const Eigen::Vector2d at = column_and_row(grid, p_sensor);
      of_columns_.add(column, at.x());
      of_rows_.add(row, at.y());
      ++returns;
    }
  }
  return returns;
}

bool CloudDirections::sees(Grid grid, const Eigen::Vector3d& p_sensor) {
  if (grid == Grid::kCameraAlongX) return p_sensor.x() > 0.0;
  if (grid == Grid::kCameraAlongZ) return p_sensor.z() > 0.0;
  return p_sensor.head<2>() != Eigen::Vector2d::Zero();
}

Eigen::Vector2d CloudDirections::column_and_row(Grid grid, const Eigen::Vector3d& p_sensor) {
  if (grid == Grid::kCameraAlongX) return {p_sensor.y() / p_sensor.x(), p_sensor.z() / p_sensor.x()};
  if (grid == Grid::kCameraAlongZ) return p_sensor.head<2>() / p_sensor.z();
  const double azimuth_rad = std::atan2(p_sensor.y(), p_sensor.x());
  const double slope = p_sensor.z() / p_sensor.head<2>().norm();  // tangent of the elevation
  return grid == Grid::kRingIsRow ? Eigen::Vector2d(azimuth_rad, slope) : Eigen::Vector2d(slope, azimuth_rad);
}

Eigen::Vector3d CloudDirections::at(std::size_t place) const {
  const double column = columns_[place % columns_.size()];
  const double row = rows_[place / columns_.size()];
  switch (grid_) {
    case Grid::kRingIsRow:
      return {std::cos(column), std::sin(column), row};
    case Grid::kRingIsColumn:
      return {std::cos(row), std::sin(row), column};
    case Grid::kCameraAlongX:
      return {1.0, column, row};
    case Grid::kCameraAlongZ:
      break;
  }
  return {column, row, 1.0};
}

}  // namespace situation_awareness

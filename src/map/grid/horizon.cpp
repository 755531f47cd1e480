// SPDX-License-Identifier: BSD-3-Clause
#include "horizon.hpp"

#include <array>
#include <cmath>
#include <limits>

namespace situation_awareness {
namespace {

constexpr std::size_t kAtOnce = 32;  ///< rings

/// Grows with the angle of a vector, from 0 to 4, without a call of atan2: along the square through the axes at 1.
double quarters(const Eigen::Vector2d& v) {
  const double sum = std::abs(v.x()) + std::abs(v.y());
  if (sum == 0.0) return 0.0;
  if (v.y() >= 0.0) return v.x() >= 0.0 ? v.y() / sum : 1.0 - v.x() / sum;
  return v.x() < 0.0 ? 2.0 - v.y() / sum : 3.0 + v.x() / sum;
}

Eigen::Vector2d unit_vector_at(double quarters) {
  const int quarter = static_cast<int>(quarters);
  const double part = quarters - quarter;
  Eigen::Vector2d v(1.0 - part, part);
  for (int i = 0; i < quarter; ++i) v = {-v.y(), v.x()};
  return v.normalized();
}

}  // namespace

Horizon::Horizon(const Elevation& elevation, double reach_m, double step_m, double class_height_m)
    : elevation_(&elevation), rings_per_m_(1.0 / step_m), rings_(static_cast<int>(std::ceil(reach_m / step_m)) + 1) {
  ground_slopes_.assign(first_place(kDirections), -std::numeric_limits<float>::infinity());
  top_slopes_ = ground_slopes_;
  for (int ring = 0; ring < rings_; ++ring) {
    rings_m_.push_back((ring + 0.5) * step_m);
    per_ring_m_.push_back(1.0 / rings_m_.back());
    class_slopes_.push_back(class_height_m / rings_m_.back());
  }
  steepest_.resize(kDirections);
  marched_.resize(kDirections);
}

void Horizon::begin(const Eigen::Vector3d& p_world_camera_m) {
  p_ = p_world_camera_m;
  std::fill(steepest_.begin(), steepest_.end(), Steepest{});
  std::fill(marched_.begin(), marched_.end(), 0);
}

void Horizon::find_slopes_before(double y_m, SeenRow& row) {
  Row<std::int32_t> directions, rings;
  find_rings(row, y_m, kDirections, kOwn_m, rings_per_m_, directions, rings);
  Row<std::size_t> places;
  for (std::size_t c = 0; c < kTileCells; ++c) {
    places[c] = row.is_in[c] != 0.0 ? place_of(directions[c], rings[c]) : 0;
  }
  for (std::size_t c = 0; c < kTileCells; ++c) row.hidden_below_m[c] = static_cast<double>(ground_slopes_[places[c]]);
}

std::size_t Horizon::place_before(const Eigen::Vector2d& away_m, double range_m, double own_m) {
  const int direction = static_cast<int>(quarters(away_m) * (kDirections / 4) + 0.5) % kDirections;
  return place_of(direction, static_cast<int>((range_m - own_m) * rings_per_m_));
}

void Horizon::march(int direction, int to_ring) {
  std::int32_t& marched = marched_[static_cast<std::size_t>(direction)];
  Steepest& steepest = steepest_[static_cast<std::size_t>(direction)];
  const Eigen::Vector2d ahead = unit_vector_at(4.0 * direction / kDirections);
  const double camera_z_m = p_.z();
  while (marched <= to_ring) {
    const auto first = static_cast<std::size_t>(marched);
    const std::size_t count = std::min(kAtOnce, static_cast<std::size_t>(rings_) - first);
    float* const ground_slopes = &ground_slopes_[first_place(direction) + 1 + first];
    float* const top_slopes = &top_slopes_[first_place(direction) + 1 + first];
    std::array<double, kAtOnce> slopes;
    elevation_->along(p_.head<2>(), ahead, &rings_m_[first], count, slopes.data());
    for (std::size_t i = 0; i < count; ++i) slopes[i] = (slopes[i] - camera_z_m) * per_ring_m_[first + i];
    Steepest so_far = steepest;
    for (std::size_t i = 0; i < count; ++i) {
      so_far.ground = std::max(so_far.ground, slopes[i]);  // but for what is not known, NaN
      so_far.top = std::max(so_far.top, slopes[i] + class_slopes_[first + i]);
      ground_slopes[i] = static_cast<float>(so_far.ground);
      top_slopes[i] = static_cast<float>(so_far.top);
    }
    steepest = so_far;
    marched += static_cast<std::int32_t>(count);
  }
}

}  // namespace situation_awareness

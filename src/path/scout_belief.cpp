// SPDX-License-Identifier: BSD-3-Clause
#include "situation_awareness/path/scout_belief.hpp"

#include <algorithm>
#include <cmath>
#include <limits>
#include <stdexcept>

namespace situation_awareness {
namespace {

// Where no source is named, none is recorded; the sensitivity of these was not measured.

/// Images of a target in full view, after which it is found by 1 - 1/e.
constexpr double kImagesUntilFound = 4.0;

constexpr double kSame_m = 4.0;       ///< a cluster that is so near to one before is that
constexpr double kFarQuality = 0.25;  ///< of an image at the end of the range, where a target is small
constexpr double kLeastHeight_m = 0.5;
constexpr std::uint16_t kEnoughImages = 3;  ///< for evidence on a cell in view

double slope_below(double angle_rad) {  // distance over height of a ray so far below level
  return angle_rad > 1e-3 ? 1.0 / std::tan(std::min(angle_rad, 0.5 * kPi)) : std::numeric_limits<double>::infinity();
}

/// The eighth of the circle, counterclockwise from the x axis, that has a direction.
std::size_t sector_of(Eigen::Vector2d to) {
  std::size_t sector = 0;
  if (to.y() < 0.0 || (to.y() == 0.0 && to.x() < 0.0)) {
    to = -to;
    sector = 4;
  }
  if (to.x() > 0.0) return sector + (to.y() < to.x() ? 0 : 1);
  return sector + (-to.x() < to.y() ? 2 : 3);
}

}  // namespace

void ScoutCameraParams::validate() const {
  check_bounds(*this, "camera");
  if (!(0.5 * vertical_field_of_view_rad - pitch_rad > 0.01)) {
    throw std::invalid_argument("camera.pitch_rad must be below vertical_field_of_view_rad / 2, or no ground is seen");
  }
}

bool is_in_view(const ScoutCameraParams& camera, const ScoutView& view, const Eigen::Vector2d& p_world_m) {
  const Eigen::Vector2d to_m = p_world_m - view.p_world_m;
  const double slope = to_m.norm() / std::max(view.height_m, kLeastHeight_m);
  if (slope < slope_below(0.5 * camera.vertical_field_of_view_rad - camera.pitch_rad) ||
      slope > slope_below(-0.5 * camera.vertical_field_of_view_rad - camera.pitch_rad)) {
    return false;
  }
  return std::abs(wrap_to_pi(std::atan2(to_m.y(), to_m.x()) - view.yaw_rad)) <= 0.5 * camera.field_of_view_rad;
}

ScoutBelief::ScoutBelief(const ScoutCameraParams& camera, const Eigen::Vector2d& low_world_m,
                         const Eigen::Vector2d& high_world_m, double cell_m, double expected)
    : camera_((camera.validate(), camera)),
      cell_m_(cell_m),
      expected_(expected),
      near_slope_(slope_below(0.5 * camera.vertical_field_of_view_rad - camera.pitch_rad)),
      far_slope_(slope_below(-0.5 * camera.vertical_field_of_view_rad - camera.pitch_rad)) {
  const Eigen::Vector2d size_m = high_world_m - low_world_m;
  columns_ = std::max(1, static_cast<int>(std::ceil(size_m.x() / cell_m - 1e-9)));
  rows_ = std::max(1, static_cast<int>(std::ceil(size_m.y() / cell_m - 1e-9)));
  low_m_ = low_world_m;
  place_m_ = {size_m.x() / columns_, size_m.y() / rows_};
  for (int row = 0; row < rows_; ++row) {
    for (int column = 0; column < columns_; ++column) {
      Place place;
      place.p_m = low_world_m + Eigen::Vector2d((column + 0.5) * place_m_.x(), (row + 0.5) * place_m_.y());
      place.expected = expected / (columns_ * rows_);
      places_.push_back(place);
    }
  }
  cells_ = places_.size();
}

double ScoutBelief::look(const ScoutView& view, double images) {
  Cone cone;
  cone.height_m = std::max(view.height_m, kLeastHeight_m);
  cone.near_m = near_slope_ * cone.height_m;
  cone.far_m = std::min(camera_.range_m, far_slope_ * cone.height_m);
  cone.ahead = {std::cos(view.yaw_rad), std::sin(view.yaw_rad)};
  cone.least_cosine = std::cos(0.5 * camera_.field_of_view_rad);
  // The rectangle around it.
  Eigen::Vector2d low_m = view.p_world_m, high_m = view.p_world_m;
  const auto reach = [&](const Eigen::Vector2d& direction) {
    const Eigen::Vector2d p_m = view.p_world_m + cone.far_m * direction;
    low_m = low_m.cwiseMin(p_m);
    high_m = high_m.cwiseMax(p_m);
  };
  for (const double side : {-0.5, 0.5}) {
    const double angle_rad = view.yaw_rad + side * camera_.field_of_view_rad;
    reach({std::cos(angle_rad), std::sin(angle_rad)});
  }
  for (const Eigen::Vector2d& axis :
       {Eigen::Vector2d(1, 0), Eigen::Vector2d(0, 1), Eigen::Vector2d(-1, 0), Eigen::Vector2d(0, -1)}) {
    if (axis.dot(cone.ahead) >= cone.least_cosine) reach(axis);
  }
  const Eigen::Array2d first = ((low_m - low_m_).array() / place_m_.array()).floor();
  const Eigen::Array2d last = ((high_m - low_m_).array() / place_m_.array()).floor();
  const auto index = [](double place, int count) {
    return static_cast<std::size_t>(std::clamp(place, 0.0, static_cast<double>(count)));
  };
  double gain = 0.0;
  for (std::size_t row = index(first.y(), rows_); row < index(last.y() + 1.0, rows_); ++row) {
    for (std::size_t column = index(first.x(), columns_); column < index(last.x() + 1.0, columns_); ++column) {
      gain += look_at(places_[row * static_cast<std::size_t>(columns_) + column], cone, view.p_world_m, images);
    }
  }
  for (std::size_t i = cells_; i < places_.size(); ++i) gain += look_at(places_[i], cone, view.p_world_m, images);
  return gain;
}

double ScoutBelief::look_at(Place& place, const Cone& cone, const Eigen::Vector2d& from_m, double images) const {
  const Eigen::Vector2d to_m = place.p_m - from_m;
  const double along_m = cone.ahead.dot(to_m);
  const double distance_m2 = to_m.squaredNorm();
  if (distance_m2 > cone.far_m * cone.far_m || distance_m2 < cone.near_m * cone.near_m) return 0.0;
  if (along_m <= 0.0 || along_m * along_m < cone.least_cosine * cone.least_cosine * distance_m2) return 0.0;
  const std::size_t k = sector_of(to_m);
  const float found = place.found[k];
  if (found < 0.0F) return 0.0;
  const double distance_m = std::sqrt(distance_m2);
  place.looks[k] = static_cast<std::uint16_t>(std::min(65535.0, place.looks[k] + std::ceil(images)));
  const double clear = std::exp(-camera_.hiding * distance_m / cone.height_m);
  if (clear <= static_cast<double>(found)) return 0.0;
  const double part = distance_m / camera_.range_m;
  const double quality = part < 0.5 ? 1.0 : 1.0 - (1.0 - kFarQuality) * (2.0 * part - 1.0);
  const double now = static_cast<double>(found) +
                     (clear - static_cast<double>(found)) * (1.0 - std::exp(-quality * images / kImagesUntilFound));
  const double left = place.left * (1.0 - now) / (1.0 - static_cast<double>(found));
  const double gain = place.expected * (place.left - left);
  place.left = left;
  place.found[k] = static_cast<float>(std::min(now, 0.9999));
  return gain;
}

void ScoutBelief::set_tentative(const std::vector<GridCluster>& clusters) {
  std::vector<Place> places;
  for (const GridCluster& cluster : clusters) {
    Place place;
    place.p_m = cluster.p_world_m;
    for (std::size_t i = cells_; i < places_.size(); ++i) {
      if ((places_[i].p_m - cluster.p_world_m).norm() < kSame_m) place = places_[i];
    }
    place.expected = std::clamp(cluster.probability - 0.5, 0.0, 0.5);
    places.push_back(place);
  }
  places_.resize(cells_);
  places_.insert(places_.end(), places.begin(), places.end());
}

void ScoutBelief::take_unobserved(const SemanticGrid& grid) {
  if (grid.probability.size() != static_cast<std::size_t>(grid.width) * static_cast<std::size_t>(grid.height)) return;
  for (std::size_t i = 0; i < cells_; ++i) {
    Place& place = places_[i];
    if (std::none_of(place.looks.begin(), place.looks.end(), [](int n) { return n >= kEnoughImages; })) continue;
    bool is_observed = false;
    const auto column = [&](double x) { return static_cast<int>(std::floor(x / grid.cell_m)) - grid.first_column; };
    const auto row = [&](double y) { return static_cast<int>(std::floor(y / grid.cell_m)) - grid.first_row; };
    const double half_m = 0.5 * cell_m_;
    for (int r = std::max(row(place.p_m.y() - half_m), 0); r <= row(place.p_m.y() + half_m) && !is_observed; ++r) {
      if (r >= grid.height) break;
      for (int c = std::max(column(place.p_m.x() - half_m), 0); c <= column(place.p_m.x() + half_m); ++c) {
        if (c >= grid.width) break;
        if (std::isnan(grid.probability[grid.index(c, r)])) continue;
        is_observed = true;
        break;
      }
    }
    if (is_observed) continue;
    place.left = 1.0;
    for (std::size_t k = 0; k < kSectors; ++k) {
      if (place.looks[k] >= kEnoughImages) place.found[k] = -1.0F;
      if (place.found[k] > 0.0F) place.left *= 1.0 - static_cast<double>(place.found[k]);
    }
  }
}

double ScoutBelief::left() const {
  double sum = 0.0;
  for (const Place& place : places_) sum += place.expected * place.left;
  return sum;
}

}  // namespace situation_awareness

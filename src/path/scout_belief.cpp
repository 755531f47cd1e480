// SPDX-License-Identifier: BSD-3-Clause
#include "situation_awareness/path/scout_belief.hpp"

#include <algorithm>
#include <cmath>
#include <limits>
#include <stdexcept>

namespace situation_awareness {
namespace {

constexpr double kSame_m = 4.0;       ///< a cluster that is so near to one before is that
constexpr double kFarQuality = 0.25;  ///< of an image at the end of the range, where a target is small
constexpr double kLeastHeight_m = 0.5;
constexpr std::uint16_t kEnoughImages = 3;  ///< for evidence on a cell in view

double slope_below(double angle_rad) {  // distance over height of a ray so far below level
  return angle_rad > 1e-3 ? 1.0 / std::tan(std::min(angle_rad, 0.5 * kPi)) : std::numeric_limits<double>::infinity();
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
  const int columns = std::max(1, static_cast<int>(std::ceil(size_m.x() / cell_m - 1e-9)));
  const int rows = std::max(1, static_cast<int>(std::ceil(size_m.y() / cell_m - 1e-9)));
  for (int row = 0; row < rows; ++row) {
    for (int column = 0; column < columns; ++column) {
      Place place;
      place.p_m = low_world_m + Eigen::Vector2d((column + 0.5) * size_m.x() / columns, (row + 0.5) * size_m.y() / rows);
      place.expected = expected / (columns * rows);
      places_.push_back(place);
    }
  }
  cells_ = places_.size();
}

double ScoutBelief::look(const ScoutView& view, double images) {
  const double height_m = std::max(view.height_m, kLeastHeight_m);
  const double near_m = near_slope_ * height_m, far_m = std::min(camera_.range_m, far_slope_ * height_m);
  const Eigen::Vector2d ahead(std::cos(view.yaw_rad), std::sin(view.yaw_rad));
  const double least_cosine = std::cos(0.5 * camera_.field_of_view_rad);
  double gain = 0.0;
  for (Place& place : places_) {
    const Eigen::Vector2d to_m = place.p_m - view.p_world_m;
    const double along_m = ahead.dot(to_m);
    const double distance_m2 = to_m.squaredNorm();
    if (distance_m2 > far_m * far_m || distance_m2 < near_m * near_m) continue;
    if (along_m <= 0.0 || along_m * along_m < least_cosine * least_cosine * distance_m2) continue;
    const double distance_m = std::sqrt(distance_m2);
    const double from_rad = std::atan2(-to_m.y(), -to_m.x()) + kPi;  // the camera's direction, seen from the place
    const auto k = std::min(kSectors - 1, static_cast<std::size_t>(from_rad / (2.0 * kPi) * kSectors));
    const float found = place.found[k];
    if (found < 0.0F) continue;
    place.looks[k] = static_cast<std::uint16_t>(std::min(65535.0, place.looks[k] + std::ceil(images)));
    const double clear = std::exp(-camera_.hiding * distance_m / height_m);
    if (clear <= static_cast<double>(found)) continue;
    const double part = distance_m / camera_.range_m;
    const double quality = part < 0.5 ? 1.0 : 1.0 - (1.0 - kFarQuality) * (2.0 * part - 1.0);
    const double now = static_cast<double>(found) +
                       (clear - static_cast<double>(found)) * (1.0 - std::exp(-quality * images / camera_.images));
    const double left = place.left * (1.0 - now) / (1.0 - static_cast<double>(found));
    gain += place.expected * (place.left - left);
    place.left = left;
    place.found[k] = static_cast<float>(std::min(now, 0.9999));
  }
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

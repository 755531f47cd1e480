// SPDX-License-Identifier: BSD-3-Clause
#include "situation_awareness/pipeline/ground_in_view.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdio>
#include <tuple>
#include <utility>

#include "situation_awareness/geometry/angles.hpp"

namespace situation_awareness {
namespace {

/// Images kept and directions of each, at most: some hundred points tell a height to metres.
constexpr std::size_t kViews = 16, kRays = 24;
/// Heights that are tried, up and down, and their step; the cells in which directions of several images meet.
constexpr double kMostHeight_m = 200.0, kHeightStep_m = 2.0, kCell_m = 3.0;
/// The map itself tries errors of the elevation up to this.
constexpr double kOwnError_m = 3.0;
/// Images that agree, at least, and the part of all; that and more of them is one height if it spans no more.
constexpr int kLeastImages = 4;
constexpr double kLeastPart = 0.6, kOneHeight_m = 20.0;
/// Steps to find where a direction meets the ground.
constexpr int kSteps = 4;
constexpr float kClass = 0.5F;

template <class... Values>
std::string formatted(const char* format, Values... values) {
  std::array<char, 256> text{};
  std::snprintf(text.data(), text.size(), format, values...);
  return text.data();
}

}  // namespace

GroundInView::GroundInView(std::shared_ptr<const Elevation> elevation, double reach_m)
    : elevation_(std::move(elevation)), reach_m_(reach_m), box_world_m_(elevation_->box_world_m()) {}

void GroundInView::add(const SoftLabels& labels, const Eigen::Isometry3d& T_world_camera, const GridUpdate& update) {
  ++images_;
  T_world_camera_ = T_world_camera;
  const auto is_known = [](float p) { return !std::isnan(p) && p != 0.5F; };
  if (std::any_of(labels.probability.begin(), labels.probability.end(), is_known)) ++known_images_;
  if (update.observed_cells > 0) ++ground_images_;
  if (update.class_cells == 0) return;
  if (class_images_++ % stride_ == 0) keep(labels, T_world_camera);
}

void GroundInView::keep(const SoftLabels& labels, const Eigen::Isometry3d& T_world_camera) {
  if (views_.size() == kViews) {
    for (std::size_t i = 0; i < kViews / 2; ++i) views_[i] = std::move(views_[2 * i]);
    views_.resize(kViews / 2);
    stride_ *= 2;
    if ((class_images_ - 1) % stride_ != 0) return;
  }
  const auto is_class = [](float p) { return p > kClass; };
  const auto count = std::count_if(labels.probability.begin(), labels.probability.end(), is_class);
  const auto step = static_cast<std::size_t>(count) / kRays + 1;
  ClassView view{T_world_camera.translation(), {}};
  const PinholeCamera& camera = labels.camera;
  std::size_t number = 0;
  for (std::size_t i = 0; i < labels.probability.size(); ++i) {
    if (!is_class(labels.probability[i]) || number++ % step != 0) continue;
    const int u = static_cast<int>(i) % camera.width, v = static_cast<int>(i) / camera.width;
    const Eigen::Vector3d ray((u - camera.cx_px) / camera.fx_px, (v - camera.cy_px) / camera.fy_px, 1.0);
    view.rays_world.push_back(T_world_camera.linear() * ray.normalized());
  }
  views_.push_back(std::move(view));
}

/// On the ground, or on a level as high as the middle of the elevation; none if it looks up.
std::optional<Eigen::Vector3d> GroundInView::looked_at() const {
  const Eigen::Vector3d from = T_world_camera_.translation(), ahead = T_world_camera_.linear().col(2);
  double ground_m = elevation_->at(from.x(), from.y());
  if (std::isnan(ground_m)) ground_m = box_world_m_.center().z();
  if (ahead.z() > -1e-2 || from.z() <= ground_m) return std::nullopt;
  const Eigen::Vector3d at = from + (ground_m - from.z()) / ahead.z() * ahead;
  return (at.array().abs() < 0.05).select(0.0, at);  // its text has a decimal, of which -0.0 is none
}

std::string GroundInView::places() const {
  const Eigen::Vector3d low = box_world_m_.min(), high = box_world_m_.max(), from = T_world_camera_.translation();
  std::string text =
      formatted("it spans x %.0f to %.0f, y %.0f to %.0f, z %.0f to %.0f m; the camera at (%.1f, %.1f, %.1f) ", low.x(),
                high.x(), low.y(), high.y(), low.z(), high.z(), from.x(), from.y(), from.z());
  if (const auto at = looked_at()) return text + formatted("looks at (%.1f, %.1f, %.1f)", at->x(), at->y(), at->z());
  const Eigen::Vector3d ahead = T_world_camera_.linear().col(2);
  const double up_deg = degrees(std::asin(std::clamp(ahead.z(), -1.0, 1.0)));
  return text + formatted("looks %.0f deg %s the horizon", std::abs(up_deg), up_deg < 0.0 ? "below" : "above");
}

std::string GroundInView::why_none() const {
  if (images_ == 0 || ground_images_ > 0) return "";
  if (known_images_ == 0) {
    return "no label of " + std::to_string(images_) + " images is known: all are NaN, 0.5 or out of [0, 1]";
  }
  if (box_world_m_.isEmpty()) return "no height of the elevation is known";
  std::string text = "no image shows ground of the elevation: " + places();
  const Eigen::Vector3d from = T_world_camera_.translation();
  const double ground_m = elevation_->at(from.x(), from.y());
  if (!std::isnan(ground_m) && from.z() <= ground_m) {
    return text +
           formatted(", and is %.1f m below the elevation: have they the same zero of height?", ground_m - from.z());
  }
  const auto at = looked_at();
  if (!at) return text + ": is its frame an optical one, with z ahead and y down?";
  const double range_m = (*at - from).head<2>().norm();
  if (range_m > reach_m_) return text + formatted(", %.0f m away, beyond grid/reach_m %g", range_m, reach_m_);
  return text + ", where its height is not known";
}

/// Images whose directions meet in one cell so far above the ground, at most.
int GroundInView::most_agreeing(double height_m) const {
  std::vector<std::tuple<int, int, std::size_t>> met;  // column, row, image
  for (std::size_t image = 0; image < views_.size(); ++image) {
    const Eigen::Vector3d& from = views_[image].p_world_m;
    for (const Eigen::Vector3d& ray : views_[image].rays_world) {
      if (ray.z() > -1e-2) continue;
      double ground_m = box_world_m_.center().z();
      Eigen::Vector3d p = from;
      for (int step = 0; step < kSteps; ++step) {
        p = from + (ground_m + height_m - from.z()) / ray.z() * ray;
        const double here_m = elevation_->at(p.x(), p.y());
        if (!std::isnan(here_m)) ground_m = here_m;
      }
      if ((p - from).dot(ray) <= 0.0) continue;
      met.emplace_back(static_cast<int>(std::floor(p.x() / kCell_m)), static_cast<int>(std::floor(p.y() / kCell_m)),
                       image);
    }
  }
  std::sort(met.begin(), met.end());
  met.erase(std::unique(met.begin(), met.end()), met.end());
  int most = 0, here = 0;
  for (std::size_t i = 0; i < met.size(); ++i) {
    const auto [column, row, image] = met[i];
    here = i > 0 && std::get<0>(met[i - 1]) == column && std::get<1>(met[i - 1]) == row ? here + 1 : 1;
    most = std::max(most, here);
  }
  return most;
}

std::optional<double> GroundInView::agreed_height_m() const {
  const int enough =
      std::max(kLeastImages, static_cast<int>(std::ceil(kLeastPart * static_cast<double>(views_.size()))));
  double low_m = kMostHeight_m, high_m = -kMostHeight_m;
  for (double height_m = -kMostHeight_m; height_m <= kMostHeight_m; height_m += kHeightStep_m) {
    if (most_agreeing(height_m) < enough) continue;
    low_m = std::min(low_m, height_m);
    high_m = std::max(high_m, height_m);
  }
  if (low_m > high_m || high_m - low_m > kOneHeight_m) return std::nullopt;
  const double height_m = 0.5 * (low_m + high_m);
  if (std::abs(height_m) < kOwnError_m) return std::nullopt;
  return height_m;
}

std::string GroundInView::why_no_target() const {
  const std::optional<double> height_m = agreed_height_m();
  if (!height_m) return "";
  return formatted("images agree where the class is %.0f m %s the elevation, not on it: ", std::abs(*height_m),
                   *height_m > 0.0 ? "above" : "below") +
         places() + ": have elevation and poses the same zero of height?";
}

}  // namespace situation_awareness

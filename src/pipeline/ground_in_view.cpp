// SPDX-License-Identifier: BSD-3-Clause
#include "situation_awareness/pipeline/ground_in_view.hpp"

#include <algorithm>
#include <cmath>
#include <tuple>
#include <utility>

#include "situation_awareness/common/format.hpp"
#include "situation_awareness/geometry/angles.hpp"

namespace situation_awareness {
namespace {

/// Images kept and directions of each, at most: some hundred points tell a height to metres.
constexpr std::size_t kViews = 16, kRays = 24;
/// Heights that are tried, up and down, and their step; the cells in which directions of several images meet.
constexpr double kMostHeight_m = 200.0, kHeightStep_m = 2.0, kCell_m = 3.0;
/// The map itself finds errors of the elevation of 2 m; from here on its targets are off.
constexpr double kOwnError_m = 2.75;
/// Finer ones, for the height at which directions meet best: by so much better than that far above and below. Things of
/// the class are met in their middle.
constexpr double kFineStep_m = 0.5, kFineCell_m = 1.0, kSharp_m = 3.0, kSharp = 1.5, kMiddle_m = 0.5;
/// Images that agree, at least, and the part of all; that and more of them is one height if it spans no more.
constexpr int kLeastImages = 4;
constexpr double kLeastPart = 0.6, kOneHeight_m = 20.0;
/// The same where few images show one thing, in a range of heights: images that meet beyond one's own.
constexpr double kNear_m = 30.0, kLeastExcess = 0.3, kManyTimes = 3.0;
/// Steps to find where a direction meets the ground.
constexpr int kSteps = 4;

bool is_class(float p) { return p > 0.5F; }

}  // namespace

GroundInView::GroundInView(std::shared_ptr<const Elevation> elevation, double reach_m)
    : elevation_(std::move(elevation)), reach_m_(reach_m), box_world_m_(elevation_->box_world_m()) {}

void GroundInView::set_elevation(std::shared_ptr<const Elevation> elevation,
                                 const Eigen::AlignedBox3d& extent_world_m) {
  elevation_ = std::move(elevation);
  box_world_m_ = elevation_->box_world_m().merged(extent_world_m);
}

std::string GroundInView::why_not_latest() const {
  if (has_latest_ground_) return "";
  return is_latest_known_ ? "no known ground in view" : "no label is known";
}

void GroundInView::add(const SoftLabels& labels, const Eigen::Isometry3d& T_world_camera, const GridUpdate& update) {
  ++images_;
  T_world_camera_ = T_world_camera;
  const auto is_known = [](float p) { return !std::isnan(p) && p != 0.5F; };
  is_latest_known_ = std::any_of(labels.probability.begin(), labels.probability.end(), is_known);
  has_latest_ground_ = update.observed_cells > 0;
  if (is_latest_known_) ++known_images_;
  if (has_latest_ground_) ++ground_images_;
  if (std::any_of(labels.probability.begin(), labels.probability.end(), is_class) && label_images_++ % stride_ == 0) {
    keep(labels, T_world_camera);
  }
  if (update.class_cells > 0) ++class_images_;
}

void GroundInView::keep(const SoftLabels& labels, const Eigen::Isometry3d& T_world_camera) {
  if (views_.size() == kViews) {
    for (std::size_t i = 0; i < kViews / 2; ++i) views_[i] = std::move(views_[2 * i]);
    views_.resize(kViews / 2);
    stride_ *= 2;
    if ((label_images_ - 1) % stride_ != 0) return;
  }
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
  ++kept_;
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
  const std::string why = why_no_ground();
  return why.empty() || remedy_.empty() ? why : why + "; " + remedy_;
}

std::string GroundInView::why_no_ground() const {
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

/// Where directions meet, on a level so far above the ground, in cells of a size.
GroundInView::Meeting GroundInView::meeting(double height_m, double cell_m) const {
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
      met.emplace_back(static_cast<int>(std::floor(p.x() / cell_m)), static_cast<int>(std::floor(p.y() / cell_m)),
                       image);
    }
  }
  std::sort(met.begin(), met.end());
  met.erase(std::unique(met.begin(), met.end()), met.end());
  Meeting meeting;
  int here = 0;
  for (std::size_t i = 0; i < met.size(); ++i) {
    const auto [column, row, image] = met[i];
    here = i > 0 && std::get<0>(met[i - 1]) == column && std::get<1>(met[i - 1]) == row ? here + 1 : 1;
    meeting.most = std::max(meeting.most, here);
    meeting.mean += (2.0 * here - 1.0) / static_cast<double>(met.size());  // of all, the sum of squares by cells
  }
  return meeting;
}

/// The height in a range at which directions meet best, if they do clearly worse a little above and below.
std::optional<double> GroundInView::sharp_height_m(double low_m, double high_m) const {
  double best_m = low_m, most = 0.0;
  for (double height_m = low_m; height_m <= high_m; height_m += kFineStep_m) {
    const double mean = meeting(height_m, kFineCell_m).mean;
    if (mean <= most) continue;
    most = mean;
    best_m = height_m;
  }
  for (const double beside_m : {-kSharp_m, kSharp_m}) {
    if (most < kSharp * meeting(best_m + beside_m, kFineCell_m).mean) return std::nullopt;
  }
  return best_m - kMiddle_m;
}

GroundInView::Height GroundInView::find_height() const {
  const int enough =
      std::max(kLeastImages, static_cast<int>(std::ceil(kLeastPart * static_cast<double>(views_.size()))));
  double low_m = kMostHeight_m, high_m = -kMostHeight_m;
  for (double height_m = -kMostHeight_m; height_m <= kMostHeight_m; height_m += kHeightStep_m) {
    if (meeting(height_m, kCell_m).most < enough) continue;
    low_m = std::min(low_m, height_m);
    high_m = std::max(high_m, height_m);
  }
  if (low_m > high_m || high_m - low_m > kOneHeight_m) {
    // Of a flight past many things a few images show the same one: there more meet than by chance.
    double best_m = 0.0, most = kLeastExcess;
    const auto excess = [this](double height_m) { return meeting(height_m, kFineCell_m).mean - 1.0; };
    for (double height_m = -kNear_m; height_m <= kNear_m; height_m += kFineStep_m) {
      const double here = excess(height_m);
      if (here <= most) continue;
      most = here;
      best_m = height_m;
    }
    const bool is_sharp = most > kLeastExcess && most > kManyTimes * excess(best_m - kSharp_m) &&
                          most > kManyTimes * excess(best_m + kSharp_m);
    if (!is_sharp || std::abs(best_m - kMiddle_m) < kOwnError_m) return {};
    return {best_m - kMiddle_m, true};
  }
  const std::optional<double> sharp_m = sharp_height_m(low_m - kHeightStep_m, high_m + kHeightStep_m);
  const double height_m = sharp_m.value_or(0.5 * (low_m + high_m));
  if (std::abs(height_m) < kOwnError_m) return {};
  return {height_m, sharp_m.has_value()};
}

const GroundInView::Height& GroundInView::height() const {
  if (height_of_views_ != kept_) height_ = find_height();
  height_of_views_ = kept_;
  return height_;
}

std::optional<double> GroundInView::agreed_height_m() const { return height().above_m; }

std::string GroundInView::why_wrong_targets() const { return height().is_sharp ? why_other_height() : ""; }

std::string GroundInView::why_other_height() const {
  const std::optional<double>& above_m = height().above_m;
  if (!above_m) return "";
  return formatted("images agree where the class is %.0f m %s the elevation, not on it: ", std::abs(*above_m),
                   *above_m > 0.0 ? "above" : "below") +
         places() + ": have elevation and poses the same zero of height?";
}

std::string GroundInView::why_no_target() const {
  const std::string other_height = why_other_height();
  if (!other_height.empty()) return other_height;
  const double enough = std::max(static_cast<double>(kLeastImages), kLeastPart * static_cast<double>(images_));
  if (class_images_ > 0 || static_cast<double>(label_images_) < enough) return "";
  return std::to_string(label_images_) + " of " + std::to_string(images_) +
         " images show the class, and none of them on known ground within grid/reach_m: " + places();
}

}  // namespace situation_awareness

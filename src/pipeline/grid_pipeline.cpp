// SPDX-License-Identifier: BSD-3-Clause
#include "situation_awareness/pipeline/grid_pipeline.hpp"

#include <algorithm>
#include <cmath>
#include <stdexcept>
#include <utility>

#include "situation_awareness/estimation/covariance.hpp"

namespace situation_awareness {
namespace {

/// Of the elevation before the first image: all of it where that is small, else next to nothing.
constexpr double kAnyReach_m = 1.0;

CameraPoseCovariance covariance_of(const CameraPoseParams& params) {
  CameraPoseCovariance covariance = CameraPoseCovariance::Zero();
  covariance.diagonal().head<3>().setConstant(params.position_sigma_m * params.position_sigma_m);
  covariance.diagonal().tail<3>().setConstant(params.attitude_sigma_rad * params.attitude_sigma_rad);
  return covariance;
}

bool is_known_well_enough(const CameraPoseCovariance& covariance, const CameraPoseParams& params) {
  return std::sqrt(covariance.diagonal().head<3>().maxCoeff()) <= params.max_position_sigma_m &&
         std::sqrt(covariance.diagonal().tail<3>().maxCoeff()) <= params.max_attitude_sigma_rad;
}

}  // namespace

GridPipeline::GridPipeline(const GridPipelineParams& params, std::shared_ptr<const Elevation> elevation)
    : params_((params.validate(), params.pose.validate(), params)),
      elevation_(std::move(elevation)),
      map_(params.grid, elevation_),
      tracks_(params.targets),
      in_view_(elevation_, params.grid.reach_m) {}

GridPipeline::GridPipeline(const GridPipelineParams& params, ElevationFile file)
    : GridPipeline(params, file.around(Eigen::Vector2d::Zero(), kAnyReach_m, params.grid.cell_m)) {
  file_.emplace(std::move(file));
  in_view_.set_remedy(file_->remedy());
}

/// Has the elevation that an image from a place needs.
void GridPipeline::look_around(const Eigen::Vector2d& p_world_m) {
  if (!file_ || !p_world_m.allFinite()) return;
  auto elevation = file_->around(p_world_m, map_.needed_reach_m(), params_.grid.cell_m);
  if (elevation == elevation_) return;
  elevation_ = std::move(elevation);
  map_.set_elevation(elevation_);
  in_view_.set_elevation(elevation_, file_->extent_world_m());
}

std::vector<std::string> GridPipeline::elevation_warnings() const {
  return file_ ? file_->warnings() : std::vector<std::string>();
}

void GridPipeline::begin_anew() {
  map_ = GridMap(params_.grid, elevation_);
  tracks_.forget();
}

const GridTargets& GridPipeline::process(const SoftLabels& labels, const Eigen::Isometry3d& T_world_camera,
                                         const std::optional<CameraPoseCovariance>& covariance) {
  if (covariance && !is_positive_semidefinite(*covariance)) {
    throw std::invalid_argument("the covariance of the camera's pose is none");
  }
  const CameraPoseCovariance of_pose = covariance ? *covariance : covariance_of(params_.pose);
  verdict_ = StampOrder::Verdict::kRefused;
  is_pose_known_ = is_known_well_enough(of_pose, params_.pose);
  if (!is_pose_known_) return tracks_.targets();
  verdict_ = order_.judge(labels.stamp_ns);
  if (verdict_ == StampOrder::Verdict::kRefused) return tracks_.targets();
  if (verdict_ == StampOrder::Verdict::kRestart) begin_anew();
  look_around(T_world_camera.translation().head<2>());
  in_view_.add(labels, T_world_camera, map_.update(labels, T_world_camera));
  if (params_.keep_m > 0.0) map_.keep_around(T_world_camera.translation().head<2>(), params_.keep_m);
  map_.read_class(class_grid_);
  find_clusters(class_grid_, clusters_);
  const GridTargets& targets =
      tracks_.update(labels.stamp_ns, clusters_, labels.camera, T_world_camera, of_pose,
                     [this](const Eigen::Vector2d& p_world_m) { return map_.is_settled(p_world_m); });
  if (params_.evidence_m > 0.0) {
    map_.settle_beyond(T_world_camera.translation().head<2>(), std::max(params_.evidence_m, params_.grid.reach_m),
                       class_grid_);
  }
  if (!targets.targets.empty()) ++target_images_;
  return targets;
}

std::string GridPipeline::why_nothing() const {
  if (target_images_ > 0 && 2 * target_images_ >= in_view_.class_images()) return in_view_.why_wrong_targets();
  const std::string none = in_view_.why_none();
  return none.empty() ? in_view_.why_no_target() : none;
}

}  // namespace situation_awareness

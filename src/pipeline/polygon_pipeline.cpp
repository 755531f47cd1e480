// SPDX-License-Identifier: BSD-3-Clause
#include "situation_awareness/pipeline/polygon_pipeline.hpp"

#include <stdexcept>
#include <string>
#include <utility>

#include "situation_awareness/points/horizontal_projection.hpp"

namespace situation_awareness {
PolygonPipeline::PolygonPipeline(const PolygonPipelineParams& params,
                                 const std::optional<ObjectPipelineParams>& objects)
    : params_(params),
      map_(params.polygons),
      objects_(objects ? std::make_unique<ObjectPipeline>(*objects) : nullptr),
      movers_(params.movers) {
  params_.scan.validate();
  params_.segments.validate();
  params_.polylines.validate();
  if (objects_) objects_->map().trust_stamps();
}

void PolygonPipeline::begin_anew() {
  map_.reset();
  movers_.reset();
  if (objects_) objects_->map().reset();
}

const PolygonPipelineResult& PolygonPipeline::process(const Scan& scan, const Eigen::Isometry3d& T_world_lidar,
                                                      const Eigen::Isometry3d& T_world_lidar_end,
                                                      const Eigen::Matrix3d& pose_covariance) {
  if (objects_) {
    latest_ = &objects_->process(scan, T_world_lidar, T_world_lidar_end);
    movers_.add(latest_->objects, latest_->segments.free_space, latest_->segments.T_world_level);
    map_segments(latest_->segments, pose_covariance);
    return result_;
  }
  const std::string defect = scan_defect(scan);
  if (!defect.empty()) throw std::invalid_argument(defect);

  limited_ = limit_range(scan, T_world_lidar, params_.scan, std::move(limited_));
  points_ = project_horizontally(limited_, T_world_lidar, T_world_lidar_end, std::move(points_));
  segments_ = segment(points_, params_.segments, std::move(segments_));
  map_segments(segments_, pose_covariance);
  return result_;
}

void PolygonPipeline::map_segments(const Segments& segments, const Eigen::Matrix3d& pose_covariance) {
  result_.polylines = extract_polylines(segments, params_.polylines, std::move(result_.polylines));
  result_.update =
      map_.update(result_.polylines, pose_covariance, movers_.at(segments.stamp_ns), std::move(result_.update));
}

ReflectorPolygonPipeline::ReflectorPolygonPipeline(const ReflectorMap& reflectors, const PolygonPipelineParams& params,
                                                   const std::optional<ObjectPipelineParams>& objects)
    : localization_(reflectors, params.reflectors, params.localization), pipeline_(params, objects) {}

bool ReflectorPolygonPipeline::process(const Scan& scan, const OdometryScan& placed) {
  const std::optional<PlacedScan> in_world = localization_.place(scan, placed);
  if (!in_world) return false;
  pipeline_.process(scan, in_world->T_world_lidar, in_world->T_world_lidar_end, in_world->covariance);
  return true;
}

}  // namespace situation_awareness

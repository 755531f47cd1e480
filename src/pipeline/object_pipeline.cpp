// SPDX-License-Identifier: BSD-3-Clause
#include "situation_awareness/pipeline/object_pipeline.hpp"

#include <stdexcept>
#include <utility>

#include "situation_awareness/points/horizontal_projection.hpp"
#include "situation_awareness/segments/divide.hpp"
#include "situation_awareness/segments/lines.hpp"

namespace situation_awareness {

ObjectPipeline::ObjectPipeline(const ObjectPipelineParams& params)
    : params_(params), detector_(make_detector(params.detections)), map_(params.objects) {
  params_.cloud.validate();
  params_.scan.validate();
  params_.segments.validate();
}

const ObjectPipelineResult& ObjectPipeline::process(const Scan& scan, const Eigen::Isometry3d& T_world_lidar) {
  return process(scan, T_world_lidar, T_world_lidar);
}

const ObjectPipelineResult& ObjectPipeline::process(const Scan& scan, const Eigen::Isometry3d& T_world_lidar,
                                                    const Eigen::Isometry3d& T_world_lidar_end) {
  if (map_may_have_changed_) result_.objects = map_.at(map_.stamp_ns(), std::move(result_.objects));
  return process(scan, T_world_lidar, T_world_lidar_end, result_.objects);
}

const ObjectPipelineResult& ObjectPipeline::process(const Scan& scan, const Eigen::Isometry3d& T_world_lidar,
                                                    const Eigen::Isometry3d& T_world_lidar_end, const Objects& known) {
  const std::string defect = scan_defect(scan);
  if (!defect.empty()) throw std::invalid_argument(defect);

  limited_ = limit_range(scan, T_world_lidar, params_.scan, std::move(limited_));
  Points& points = result_.points;
  Segments& segments = result_.segments;
  Detections& detections = result_.detections;
  points = project_horizontally(limited_, T_world_lidar, T_world_lidar_end, std::move(points));
  known_level_ = outlines_at(scan.stamp_ns, points.T_world_level, known, kMaxMapAge_s, std::move(known_level_));
  segments = divide(segment(points, params_.segments, std::move(segments)), known_level_, params_.segments);
  segments = with_straight_pieces(std::move(segments), params_.segments, params_.detections.fit.range_sigma_m);
  detections = arrivals_.mark(segments, detector_->detect(segments, known_level_, std::move(detections)));
  result_.update = map_.update(detections, std::move(result_.update));
  result_.objects = map_.at(map_.stamp_ns(), std::move(result_.objects));  // may be `known`, which was used above
  map_may_have_changed_ = false;
  result_.unmapped = unmapped_.add(segments, result_.objects);
  return result_;
}

const ObjectPipelineResult& ObjectPipeline::process(const Cloud& cloud, const Eigen::Isometry3d& T_world_sensor,
                                                    const Eigen::Isometry3d& T_world_sensor_end) {
  slice_ = slice_cloud(cloud, T_world_sensor, T_world_sensor_end, params_.cloud, std::move(slice_));
  return process(slice_.scan, slice_.T_world_level);
}

}  // namespace situation_awareness

// SPDX-License-Identifier: BSD-3-Clause
#include "situation_awareness/pipeline/object_pipeline.hpp"

#include <stdexcept>

#include "situation_awareness/detections/refine.hpp"
#include "situation_awareness/points/horizontal_projection.hpp"
#include "situation_awareness/segments/divide.hpp"

namespace situation_awareness {

ObjectPipeline::ObjectPipeline(const ObjectPipelineParams& params)
    : params_(params), detector_(make_detector(params.detections)), map_(params.objects) {
  params_.scan.validate();
  params_.segments.validate();
}

ObjectPipelineResult ObjectPipeline::process(const Scan& scan, const Eigen::Isometry3d& T_world_lidar) {
  return process(scan, T_world_lidar, T_world_lidar);
}

ObjectPipelineResult ObjectPipeline::process(const Scan& scan, const Eigen::Isometry3d& T_world_lidar,
                                             const Eigen::Isometry3d& T_world_lidar_end) {
  const std::string defect = scan_defect(scan);
  if (!defect.empty()) throw std::invalid_argument(defect);

  ObjectPipelineResult result;
  const Scan limited = limit_range(scan, T_world_lidar, params_.scan);
  result.points = project_horizontally(limited, T_world_lidar, T_world_lidar_end);
  const std::vector<Ellipse> known_level =
      outlines_at(scan.stamp_ns, result.points.T_world_level, map_.at(map_.stamp_ns()));
  result.segments = divide(segment(result.points, params_.segments), known_level, params_.segments);
  result.detections = refine(detector_->detect(result.segments), result.segments, known_level, params_.detections.fit);
  result.update = map_.update(result.detections);
  return result;
}

}  // namespace situation_awareness

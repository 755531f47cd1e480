// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <memory>
#include <utility>
#include <vector>

#include <Eigen/Geometry>

#include "situation_awareness/geometry/ellipse.hpp"
#include "situation_awareness/pipeline/arrivals.hpp"
#include "situation_awareness/pipeline/object_pipeline.hpp"
#include "situation_awareness/points/horizontal_projection.hpp"
#include "situation_awareness/segments/divide.hpp"
#include "situation_awareness/segments/lines.hpp"

namespace situation_awareness {

/// Inputs and outputs of each stage for one scan.
struct StageValues {
  Scan limited;
  Points points;
  std::vector<ExpectedOutline> known_level;
  Segments undivided;
  Segments segments;
  Detections detected;
  Detections detections;
  ObjectMapUpdate update;
  Objects map;  ///< at the stamp, as published
};

/// ObjectPipeline as separate stages, so that each can be timed. pipeline_speed asserts that both give the same maps.
class StagedPipeline {
 public:
  explicit StagedPipeline(const ObjectPipelineParams& params)
      : params_(params), detector_(make_detector(params.detections)), map_(params.objects) {}

  /// `stage(name, what)` returns what() and may time it. Values are copied between the stages, where the pipeline moves
  /// them, and only there. The result is valid until the next call.
  template <class Stage>
  const StageValues& process(const Scan& scan, const Eigen::Isometry3d& T_world_lidar,
                             const Eigen::Isometry3d& T_world_lidar_end, Stage&& stage) {
    StageValues& v = values_;
    v.limited = stage("limit", [&] { return limit_range(scan, T_world_lidar, params_.scan, std::move(v.limited)); });
    v.points = stage("project", [&] {
      return project_horizontally(v.limited, T_world_lidar, T_world_lidar_end, std::move(v.points));
    });
    v.known_level = stage("expect", [&] {
      known_ = map_.at(map_.stamp_ns(), std::move(known_));
      return outlines_at(scan.stamp_ns, v.points.T_world_level, known_, kMaxMapAge_s, std::move(v.known_level));
    });
    v.undivided = stage("segment", [&] { return segment(v.points, params_.segments, std::move(v.undivided)); });
    v.segments = v.undivided;
    v.segments = stage("divide", [&] { return divide(std::move(v.segments), v.known_level, params_.segments); });
    v.segments = stage("lines", [&] {
      return with_straight_pieces(std::move(v.segments), params_.segments, params_.detections.fit.range_sigma_m);
    });
    v.detected = stage("detect", [&] { return detector_->detect(v.segments, v.known_level, std::move(v.detected)); });
    v.detections = v.detected;
    v.detections = stage("arrivals", [&] { return arrivals_.mark(v.segments, std::move(v.detections)); });
    v.update = stage("update", [&] { return map_.update(v.detections, std::move(v.update)); });
    v.map = stage("publish", [&] { return map_.at(scan.stamp_ns, std::move(v.map)); });
    return v;
  }

  const ObjectMap& map() const { return map_; }

 private:
  ObjectPipelineParams params_;
  std::unique_ptr<ProbableDetector> detector_;
  Arrivals arrivals_;
  ObjectMap map_;
  Objects known_;
  StageValues values_;
};

}  // namespace situation_awareness

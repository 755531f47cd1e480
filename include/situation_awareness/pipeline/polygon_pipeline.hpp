// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <memory>
#include <optional>

#include <Eigen/Core>
#include <Eigen/Geometry>

#include "situation_awareness/common/params.hpp"
#include "situation_awareness/geometry/pose2.hpp"
#include "situation_awareness/map/polygons/polygon_map.hpp"
#include "situation_awareness/map/polygons/polygons.hpp"
#include "situation_awareness/pipeline/localization_pipeline.hpp"
#include "situation_awareness/pipeline/moving_objects.hpp"
#include "situation_awareness/pipeline/object_pipeline.hpp"
#include "situation_awareness/points/points.hpp"
#include "situation_awareness/polylines/polyline_extraction.hpp"
#include "situation_awareness/polylines/polylines.hpp"
#include "situation_awareness/pose/reflector_localization.hpp"
#include "situation_awareness/pose/reflector_map.hpp"
#include "situation_awareness/pose/reflectors.hpp"
#include "situation_awareness/scan/range_limiter.hpp"
#include "situation_awareness/scan/scan.hpp"
#include "situation_awareness/segments/segmentation.hpp"
#include "situation_awareness/segments/segments.hpp"

namespace situation_awareness {

/// All parameters of the pipeline from scan to the map of polygons; cfg/polygons.yaml mirrors it.
struct PolygonPipelineParams {
  RangeLimiterParams scan;
  SegmentationParams segments;
  ReflectorDetectionParams reflectors;
  ReflectorLocalizationParams localization;
  PolylineParams polylines;
  PolygonMapParams polygons;
  MoverParams movers;

  template <class Self, class Visit>
  static void fields(Self& self, Visit&& visit) {
    visit("scan", self.scan);
    visit("segments", self.segments);
    visit("reflectors", self.reflectors);
    visit("localization", self.localization);
    visit("polylines", self.polylines);
    visit("polygons", self.polygons);
    visit("movers", self.movers);
  }
};

/// The results of all stages for one scan.
struct PolygonPipelineResult {
  Polylines polylines;
  PolygonMapUpdate update;
};

/// From scan to the map of polygons in one thread, without ROS; with `objects` to the map of objects, too, from the
/// same segments, and what that follows is kept off the map of polygons.
class PolygonPipeline {
 public:
  /// With `objects`, their parameters hold for the scan and its segments. Throws std::invalid_argument naming field and
  /// bound, and as ObjectPipeline.
  explicit PolygonPipeline(const PolygonPipelineParams& params,
                           const std::optional<ObjectPipelineParams>& objects = std::nullopt);

  /// Throws std::invalid_argument if the scan or the pose cannot be used; the map is then unchanged. `pose_covariance`:
  /// of the error of the pose in x, y (m) and yaw (rad), in the axes of the world. The result is valid until the next
  /// call, which reuses its memory.
  const PolygonPipelineResult& process(const Scan& scan, const Eigen::Isometry3d& T_world_lidar,
                                       const Eigen::Isometry3d& T_world_lidar_end,
                                       const Eigen::Matrix3d& pose_covariance);

  /// New maps, of another time. Ids are not used again. The stamps of scans are judged by the caller.
  void begin_anew();

  PolygonMap& map() { return map_; }
  /// Of the latest scan, limited to what is of interest.
  const Points& points() const { return latest_ != nullptr ? latest_->points : points_; }
  /// The map of objects and what its latest scan was to it; null without one.
  const ObjectPipelineResult* objects() const { return latest_; }
  const MovingObjects& movers() const { return movers_; }

 private:
  void map_segments(const Segments& segments, const Eigen::Matrix3d& pose_covariance);

  PolygonPipelineParams params_;
  PolygonMap map_;
  std::unique_ptr<ObjectPipeline> objects_;
  const ObjectPipelineResult* latest_ = nullptr;
  MovingObjects movers_;
  Scan limited_;
  Points points_;
  Segments segments_;
  PolygonPipelineResult result_;
};

/// The same with the pose by reflectors and odometry, for a base that moves in the plane.
class ReflectorPolygonPipeline {
 public:
  /// Throws std::invalid_argument naming field and bound.
  ReflectorPolygonPipeline(const ReflectorMap& reflectors, const PolygonPipelineParams& params,
                           const std::optional<ObjectPipelineParams>& objects = std::nullopt);

  ReflectorLocalization& localization() { return localization_.localization(); }
  LocalizationPipeline& localization_pipeline() { return localization_; }
  const LocalizationPipeline& localization_pipeline() const { return localization_; }
  PolygonPipeline& pipeline() { return pipeline_; }

  /// Localises by the scan and, where the pose is known then, maps it. The odometry up to the scan has been added to
  /// localization(). Returns whether the pose is known. Throws std::invalid_argument if the scan or a pose cannot be
  /// used.
  bool process(const Scan& scan, const OdometryScan& placed);

 private:
  LocalizationPipeline localization_;
  PolygonPipeline pipeline_;
};

}  // namespace situation_awareness

// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstdint>
#include <optional>
#include <vector>

#include <Eigen/Core>
#include <Eigen/Geometry>

#include "situation_awareness/common/params.hpp"
#include "situation_awareness/geometry/pose2.hpp"
#include "situation_awareness/map/grid/grid.hpp"
#include "situation_awareness/map/id_source.hpp"
#include "situation_awareness/map/map.hpp"
#include "situation_awareness/map/semantic_map.hpp"
#include "situation_awareness/pipeline/moving_objects.hpp"
#include "situation_awareness/pipeline/object_pipeline.hpp"
#include "situation_awareness/pipeline/splinegon_pipeline.hpp"
#include "situation_awareness/points/points.hpp"
#include "situation_awareness/scan/scan.hpp"

namespace situation_awareness {

/// Parameters of the pipeline to one map; cfg/map.yaml mirrors them and those of the objects.
struct MapPipelineParams {
  SplinegonPipelineParams layers;
  MoverParams movers;
  HandOverParams hand_over;

  template <class Self, class Visit>
  static void fields(Self& self, Visit&& visit) {
    SplinegonPipelineParams::fields(self.layers, visit);
    visit("movers", self.movers);
    visit("hand_over", self.hand_over);
  }
};

/// What is mapped: bodies that move or may, chains of what stands, and boundaries of large obstacles.
struct MapKinds {
  bool objects = true, polygons = true, boundaries = true;
};

/// From scans, and the targets of images, to one map of all that is around, in one thread, without ROS
/// (docs/math/semantic_map.md).
class MapPipeline {
 public:
  /// Throws std::invalid_argument naming field and bound, and as ObjectPipeline. `objects` are used if they are mapped;
  /// their parameters of the scan and its segments hold for all kinds then. `robot`: number of the robot whose ids are
  /// given.
  MapPipeline(const MapPipelineParams& params, const ObjectPipelineParams& objects, const MapKinds& kinds,
              std::uint64_t robot = 0);
  MapPipeline(const MapPipeline&) = delete;
  MapPipeline& operator=(const MapPipeline&) = delete;

  /// Maps a scan at a pose that is known well, as SplinegonPipeline::process. The result, in the world, is valid until
  /// the next call.
  const MapUpdate& process(const Scan& scan, const Eigen::Isometry3d& T_world_lidar,
                           const Eigen::Isometry3d& T_world_lidar_end, const Eigen::Matrix3d& pose_covariance);

  /// Maps a scan by inertial navigation. All calls are of one of these two kinds. Where GPS and INS have learned
  /// meanwhile that the map is elsewhere in the world, by more than a part of the standard deviation of its place, all
  /// features have changed.
  const MapUpdate& process(const Scan& scan, const Eigen::Isometry3d& T_odom_lidar,
                           const Eigen::Isometry3d& T_odom_lidar_end, const InertialPlacement& placement);

  /// Takes the targets of images over, which are in the world. With poses that are known well only.
  const MapUpdate& take(const GridTargets& targets);

  /// Another map, of another time. Ids are not used again.
  void begin_anew();

  /// The whole map in the world. `memory`: as for limit_range.
  Map map(Map memory = {}) const;
  std::size_t size() const { return map_.size(); }

  /// The points of the latest scan, limited to what is of interest.
  const Points& points() const;
  const SplinegonPipeline& layers() const { return layers_; }

 private:
  const MapUpdate& tell(const Scan& scan, double height_world_m);
  bool is_elsewhere() const;

  IdSource ids_;
  MapKinds kinds_;
  SplinegonPipeline layers_;
  SemanticMap map_;
  PolygonChanges chains_;
  std::optional<Pose2> T_world_map_;  ///< by which all features were told, by inertial navigation
  double variance_m2_ = 0.0;          ///< of that place
  double reach_m_ = 0.0;              ///< of the features from the origin of the map, at most
  MapUpdate update_;                  ///< in the world, by inertial navigation
  Map all_;
};

}  // namespace situation_awareness

// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include <Eigen/Core>
#include <Eigen/Geometry>

#include "situation_awareness/common/params.hpp"
#include "situation_awareness/geometry/pose2.hpp"
#include "situation_awareness/map/grid/grid.hpp"
#include "situation_awareness/map/id_source.hpp"
#include "situation_awareness/map/map.hpp"
#include "situation_awareness/map/objects/objects.hpp"
#include "situation_awareness/map/saved_map.hpp"
#include "situation_awareness/map/semantic_map.hpp"
#include "situation_awareness/pipeline/moving_objects.hpp"
#include "situation_awareness/pipeline/object_pipeline.hpp"
#include "situation_awareness/pipeline/splinegon_pipeline.hpp"
#include "situation_awareness/points/points.hpp"
#include "situation_awareness/scan/scan.hpp"
#include "situation_awareness/segments/segments.hpp"

namespace situation_awareness {

/// Parameters of the pipeline to one map; cfg/map.yaml mirrors them and those of the objects, beside those of a vehicle
/// that drives by it.
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

/// What is mapped: bodies that move or may, chains of what stands, boundaries of large obstacles, and targets of
/// images.
struct MapKinds {
  bool objects = true, polygons = true, boundaries = true, targets = false;

  bool are_of_scans() const { return objects || polygons || boundaries; }
};

/// Of "objects,polygons,splinegons,grid" or a part of it. Throws std::invalid_argument naming what is no kind.
MapKinds map_kinds_of(const std::string& names);

/// From scans, and the targets of images, to one map of all that is around, in one thread, without ROS
/// (docs/math/semantic_map.md).
class MapPipeline {
 public:
  /// Throws std::invalid_argument naming field and bound, and as ObjectPipeline. `objects` are used if they are mapped;
  /// their parameters of the scan and its segments hold for all kinds then. `robot`: number of the robot whose ids are
  /// given.
  MapPipeline(const MapPipelineParams& params, const ObjectPipelineParams& objects, const MapKinds& kinds,
              std::uint64_t robot = 0);
  /// Builds a pipeline that tracks no objects itself: it takes segments, and the map of objects, from its caller.
  /// Throws std::invalid_argument naming field and bound.
  MapPipeline(const MapPipelineParams& params, const MapKinds& kinds, std::uint64_t robot = 0);
  MapPipeline(const MapPipeline&) = delete;
  MapPipeline& operator=(const MapPipeline&) = delete;

  /// Maps a scan at a pose that is known well, as SplinegonPipeline::process. The result, in the world, is valid until
  /// the next call.
  const MapDelta& process(const Scan& scan, const Eigen::Isometry3d& T_world_lidar,
                          const Eigen::Isometry3d& T_world_lidar_end, const Eigen::Matrix3d& pose_covariance);

  /// Maps a scan by inertial navigation. All calls are of one of these two kinds. Where GPS and INS have learned
  /// meanwhile that the map is elsewhere in the world, by more than a part of the standard deviation of its place, all
  /// features have changed.
  const MapDelta& process(const Scan& scan, const Eigen::Isometry3d& T_odom_lidar,
                          const Eigen::Isometry3d& T_odom_lidar_end, const InertialPlacement& placement);

  /// Maps the segments of a scan at a pose that is known well, as SplinegonPipeline::process. `objects`: the map of
  /// objects after the scan; null if it is not known, or none are mapped.
  const MapDelta& process(const Segments& segments, const Objects* objects, const Eigen::Matrix3d& pose_covariance);

  /// Takes the targets of images over, which are in the world. With poses that are known well only.
  const MapDelta& take(const GridTargets& targets);

  /// Another map, of another time. Ids are not used again.
  void begin_anew();

  /// The map as it is to be saved; `world_frame` is left empty.
  SavedMap saved() const;

  /// Continues from what stands on a saved map, as another map: under its ids, at the places that it says, whatever
  /// time it is of. What moves is somewhere else meanwhile. By GPS it may be off by its error then and now. The result
  /// is the whole map. Throws std::invalid_argument if it is too large; nothing has changed then.
  const MapDelta& resume(const SavedMap& saved);

  /// Whether there was an update since the map began.
  bool has_map() const { return map_.has_begun(); }
  /// The whole map in the world. `memory`: as for limit_range.
  Map map(Map memory = {}) const;
  /// The whole map as a full update, with the version of the latest one.
  MapDelta whole() const;
  std::size_t size() const { return map_.size(); }

  /// The points of the latest scan, limited to what is of interest.
  const Points& points() const;
  const SplinegonPipeline& layers() const { return layers_; }

 private:
  MapPipeline(const MapPipelineParams& params, const std::optional<ObjectPipelineParams>& objects,
              const MapKinds& kinds, std::uint64_t robot);
  const MapDelta& tell(std::int64_t stamp_ns, double height_world_m, const Objects* objects,
                       const std::optional<SightOfScan>& sight);
  void resume_before(std::int64_t stamp_ns);
  const MapDelta& restore(const Map& saved, std::int64_t stamp_ns);
  void place_in_world();
  SightOfScan own_sight() const;
  const Objects* own_objects() const;
  bool is_elsewhere() const;

  IdSource ids_;
  MapKinds kinds_;
  SplinegonPipeline layers_;
  SemanticMap map_;
  PolygonChanges chains_;
  std::optional<Pose2> T_world_map_;  ///< by which all features were told, by inertial navigation
  double variance_m2_ = 0.0;          ///< of that place
  double reach_m_ = 0.0;              ///< of the features from the origin of the map, at most
  MapDelta delta_;                    ///< in the world, by inertial navigation
  Map all_;
  std::optional<Map> resumed_;  ///< the saved map, until the first scan or image after it
};

}  // namespace situation_awareness
